"""The stages that run, measure and judge engines, and the studies that use them. The public interface is `dropspin` itself."""

if __name__ != "dropspin.comparisons":  # in a checkout that is on the path
    raise ImportError("import dropspin.comparisons, not comparisons")

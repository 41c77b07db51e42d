"""The stages that run, measure and judge engines, and the studies that use them. The public interface is the module `dropspin`."""

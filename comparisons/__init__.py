"""Engines run, measured and judged: stages, and the studies on top of them. The public interface is the module `dropspin`."""

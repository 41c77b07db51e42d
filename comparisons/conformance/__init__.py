"""Is an adapter right? Checks that anybody runs on an engine of their own."""

from comparisons.conformance.checks import Finding, conform

__all__ = ["Finding", "conform"]

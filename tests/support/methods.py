"""Choices of methods of the reference implementation that tests share, so that a test session compiles each kernel once."""

COVERING = [
    {},
    {"rotation": "gyroscopic", "correction": "projection"},
    {"rotation": "implicit-gyroscopic", "law": "poisson", "correction": "projection"},
    {"rotation": "midpoint", "law": "coulomb"},
    {"rotation": "symmetric-top", "law": "clamped"},
    {"rotation": "rk4", "law": "normal"},
    {"rotation": "exact", "law": "coulomb", "contact": "sequential"},
    {"rotation": "exact", "law": "normal", "contact": "sequential", "correction": "projection"},
]
"""Every leaf, with `law=normal` and `law=coulomb` for both contacts."""

FURTHER = [
    *({"rotation": name} for name in ("gyroscopic", "implicit-gyroscopic", "midpoint", "rk4", "symmetric-top", "exact")),
    *({"law": name} for name in ("normal", "poisson", "clamped", "coulomb")),
    {"law": "normal", "contact": "sequential"},
    {"correction": "projection"},
    {"law": "clamped", "correction": "projection"},
    {"rotation": "midpoint", "law": "normal", "contact": "sequential"},
]
"""Every leaf alone, and more pairs."""

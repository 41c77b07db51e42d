"""Choices of methods of the reference implementation that tests share, so that a test session compiles each kernel once."""

COVERING = [
    {},
    {"rotation": "gyroscopic", "law": "clamped"},
    {"rotation": "implicit-gyroscopic", "law": "poisson"},
    {"rotation": "midpoint", "law": "coulomb"},
    {"rotation": "rk4", "law": "normal"},
    {"rotation": "exact", "law": "coulomb", "contact": "sequential"},
    {"rotation": "exact", "law": "normal", "contact": "sequential"},
]
"""Every leaf, with `law=normal` and `law=coulomb` for both contacts."""

FURTHER = [
    *({"rotation": name} for name in ("gyroscopic", "implicit-gyroscopic", "midpoint", "rk4", "exact")),
    *({"law": name} for name in ("normal", "poisson", "clamped", "coulomb")),
    {"law": "normal", "contact": "sequential"},
    {"rotation": "midpoint", "law": "normal", "contact": "sequential"},
]
"""Every leaf alone, and more pairs."""

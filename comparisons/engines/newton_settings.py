"""The settings of Newton's solvers and shapes that can be given, by its names: defaults, calibrated values and reasons."""

from functools import cache
from itertools import chain

from dropspin.comparisons.engines.settings import Setting, settings_beside

STICKING = 1e4
SHAPE = {name: f"shape_material_{name}" for name in ("restitution", "mu", "mu_torsional", "mu_rolling", "ke", "kd", "kf", "ka")}
SHAPE |= {name: f"shape_{name}" for name in ("margin", "gap")}
"""Names of `ShapeConfig`, with those of the model's arrays."""
XPBD, SEMI_IMPLICIT, MUJOCO = settings_beside(__file__).values()
SETTINGS = {
    "xpbd": XPBD,
    "semi-implicit": SEMI_IMPLICIT,
    "featherstone": {name: one for name, one in SEMI_IMPLICIT.items() if name != "angular_damping"},
    "mujoco": MUJOCO | {name: SEMI_IMPLICIT[name] for name in ("mu", "ke", "kd")},
}
"""By solver."""


@cache
def settings_of(solver: str) -> dict[str, Setting]:
    """The settings, with the defaults of a solver; those that it does not have need one that has them."""
    found = dict(SETTINGS.get(solver, {}))
    for name, setting in chain.from_iterable(settings.items() for settings in SETTINGS.values()):
        having = [other for other, settings in SETTINGS.items() if name in settings]
        found.setdefault(name, setting._replace(needs=(("solver", *having),)))
    return found

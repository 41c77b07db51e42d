"""The engines with an environment of their own, and what is expected of them: `make test-engines`; a line for each label."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Case(NamedTuple):
    """What is expected of an engine with some options.

    Attributes:
        label: The engine with its options.
        turned: The orientation error of the scene `spin-asymmetric` after 1 s with steps of 2 ms [rad], as it was measured.
        restitution: The restitution error of a ball dropped from 1 m, at most; None if the engine declines it.
        batch: The largest difference of a batch from single simulations in 0.2 s of tumbling, in eps of 1; 0 for the same bits, None
            if the engine cannot step a batch.
        failing: The check of conformance that fails because of the engine, as docs/engines.md says, and how its message begins.
    """

    label: str
    turned: float
    restitution: float | None
    batch: float | None = 0.0
    failing: Mapping[str, str] = MappingProxyType({})


CASES = {
    "mjx": [Case("mjx", 2.9e-4, 1e-6, batch=4), Case("mjx[precision=float64]", 2.9e-4, 1e-6, batch=32)],
    "mujoco-warp": [Case("mujoco-warp", 2.9e-4, 1e-6)],
    "newton": [
        Case("newton", 3.2e-4, 3e-3),
        Case("newton[solver=semi-implicit]", 3.1e-4, None),
        Case("newton[solver=featherstone]", 2.9e-4, None),
        Case("newton[solver=mujoco]", 2.9e-4, None),
    ],
    "exudyn": [
        Case("exudyn", 1.24e-7, None, batch=None),
        Case("exudyn[integrator=trapezoidal]", 1.23e-7, None, batch=None),
        Case("exudyn[integrator=midpoint]", 9.3e-8, None, batch=None),
    ],
    "jsbsim": [
        Case("jsbsim", 2.85e-4, None, batch=None),
        Case("jsbsim[integrator=trapezoidal]", 5.69e-4, None, batch=None),
        Case("jsbsim[integrator=adams-bashforth-5]", 7.3e-7, None, batch=None),
        Case("jsbsim[integrator=local-linearization]", 3.5e-7, None, batch=None),
    ],
    "genesis": [Case("genesis[precision=float64]", 8.35e-8, None)],
    "brax": [Case("brax", 0.142, 2.5e-3, batch=32), Case("brax[pipeline=generalized]", 2.92e-4, None, batch=32)],
    "rapier-js": [Case("rapier-js", 2.8e-4, 1e-6, batch=None)],
    "cannon-es": [
        Case("cannon-es", 0.142, 1e-9, batch=None, failing={"spinning corner": "restitution acts on the velocity of the centre"})
    ],
    "jolt": [Case("jolt", 2.75e-4, 1e-6, batch=None)],
    "havok": [Case("havok", 0.142, 5e-3, batch=None)],
    "box3d": [Case("box3d", 7.2e-5, 1e-6, batch=None)],
    "ode": [Case("ode", 6.56e-4, 1e-6, batch=None)],
    "sapien": [Case("sapien", 2.8e-4, 2.5e-3, batch=None)],
}

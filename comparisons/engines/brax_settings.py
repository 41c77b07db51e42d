"""The settings of brax that can be given, by the names of its `System` and of MJCF, and scenes in MJCF with them."""

import math
from collections.abc import Mapping
from typing import Any

from dropspin.comparisons.engines.options import Setting, spelled
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Sphere

SPRING, GENERALIZED = (("pipeline", "spring"),), (("pipeline", "generalized"),)
FLIGHT = {
    "vel_damping": Setting(
        0.0,
        "rate at which the velocity grows, negative to damp",
        why="minus the scene's decay rate",
        unit="1/s",
        least=-math.inf,
        is_computed=True,
        needs=SPRING,
    ),
    "ang_damping": Setting(
        0.0, "as vel_damping, of the spin", why="as vel_damping", unit="1/s", least=-math.inf, is_computed=True, needs=SPRING
    ),
    "matrix_inv_iterations": Setting(10, "steps that invert the mass matrix; with 0 it is inverted directly", needs=GENERALIZED),
}
"""With and without a floor."""
CONTACT = {
    "baumgarte_erp": Setting(
        0.1,
        "share of the depth that a step corrects",
        0.0,
        "0; the default, 0.1, adds a tenth of the penetration per step to the speed of a rebound",
        most=1.0,
        needs=SPRING,
    ),
    "elasticity": Setting(
        0.0,
        "restitution of the body; the mean of both acts",
        why="the scene's restitution, of body and floor: brax takes the mean of both",
        most=1.0,
        is_computed=True,
        needs=SPRING,
    ),
    "floor_elasticity": Setting(0.0, "restitution of the floor", most=1.0, is_computed=True, needs=SPRING),
    "friction": Setting(1.0, "of the body; the larger acts", is_computed=True),
    "floor_friction": Setting(1.0, "of the floor", is_computed=True),
    "spring_mass_scale": Setting(0.0, "contacts have the mass to the power of 1 minus this", most=1.0, needs=SPRING),
    "spring_inertia_scale": Setting(0.0, "as spring_mass_scale, of the moments of inertia", most=1.0, needs=SPRING),
    "solref": Setting((0.02, 1.0), "time constant and damping ratio of contacts", unit="s, 1", least=-math.inf, needs=GENERALIZED),
    "solimp": Setting((0.9, 0.95, 0.001, 0.5, 2.0), "impedance of contacts", unit="1, 1, m, 1, 1", needs=GENERALIZED),
    "solver_iterations": Setting(100, "steps of the contact solver", least=1, needs=GENERALIZED),
    "solver_maxls": Setting(20, "steps of the contact solver's line search", least=1, needs=GENERALIZED),
}
"""With a floor."""
SETTINGS = FLIGHT | CONTACT
NUMERICS = (
    *("vel_damping", "ang_damping", "matrix_inv_iterations", "baumgarte_erp"),
    *("spring_mass_scale", "spring_inertia_scale", "solver_maxls"),
)
"""Those that MJCF has as custom numerics."""
OF_SHAPES = {"elasticity": "elasticity", "friction": "geom_friction", "solref": "geom_solref", "solimp": "geom_solimp"}
"""Those that each shape has, and their names in a `System`."""


def description(scene: Scenario, dt: float, chosen: Mapping[str, Any]) -> str:
    """A scene as MJCF; its mass and inertia are set later."""
    written = {name: spelled(value) for name, value in chosen.items()}
    options = {"timestep": repr(dt), "gravity": spelled(scene.acceleration.tolist())}
    if "solver_iterations" in written:
        options["iterations"] = written["solver_iterations"]
    numerics, solver, plane, shape = {name: written[name] for name in NUMERICS if name in written}, dict[str, str](), "", ""
    if scene.floor is not None:
        body = scene.body
        numerics["elasticity"] = f"{written['floor_elasticity']} {written['elasticity']}"
        solver = {name: written[name] for name in ("solref", "solimp") if name in written}
        size = spelled(body.radius if isinstance(body, Sphere) else body.vertices.max(0).tolist())
        plane = f'<geom type="plane" size="0 0 1" zaxis="0 1 0" friction="{written["floor_friction"]} 0 0"/>'
        shape = f'<geom type="{body.shape}" size="{size}" friction="{written["friction"]} 0 0"/>'
    custom = "".join(f'<numeric name="{name}" data="{text}"/>' for name, text in numerics.items())
    tables = f"<option {_attributes(options)}/><custom>{custom}</custom><default><geom {_attributes(solver)}/></default>"
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    return f"<mujoco>{tables}<worldbody>{plane}<body><freejoint/>{inertial}{shape}</body></worldbody></mujoco>"


def _attributes(written: Mapping[str, str]) -> str:
    return " ".join(f'{name}="{text}"' for name, text in written.items())

"""The settings of brax that can be given, by the names of its `System` and of MJCF, and scenes in MJCF with them."""

from collections.abc import Mapping
from typing import Any

from dropspin.comparisons.engines.settings import settings_beside, spelled
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Sphere

FLIGHT, CONTACT = settings_beside(__file__).values()
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

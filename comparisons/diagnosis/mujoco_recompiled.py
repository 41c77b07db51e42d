"""A specification as MuJoCo compiles it without some of what changes masses and inertias.

Functions from a specification, which they do not change, to the model with its data; None if MuJoCo refuses it.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from typing import Any

import mujoco

from dropspin.comparisons.diagnosis.mujoco_compiled import placed
from dropspin.comparisons.engines.mujoco_simulation import quiet

LEAST = 2e-15
"""Just above the smallest mass [kg] and moment [kg m²] that MuJoCo accepts: those of bodies of which a file says nothing."""
NEUTRAL: Mapping[str, Any] = {
    "boundmass": LEAST,
    "boundinertia": LEAST,
    "settotalmass": -1.0,
    "inertiafromgeom": mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO,
    "inertiagrouprange": [0, mujoco.mjNGROUP - 1],
}
"""Settings of the compiler that change masses and possible inertias of a file, with the values at which they change none."""
CHANGED = 8
"""Models of a file that are kept: without each setting, and without all."""


@lru_cache(CHANGED)
def without(spec: Any, *settings: str) -> tuple[Any, Any] | None:
    """The model without the effect of some settings of the compiler; impossible inertias are balanced."""
    spec = spec.copy()
    spec.compiler.balanceinertia = True
    for name in settings:
        setattr(spec.compiler, name, NEUTRAL[name])
    return _compiled(spec)


@lru_cache(1)
def with_exact_volumes(spec: Any) -> tuple[Any, Any] | None:
    """With exact volumes of meshes, of which MuJoCo counts parts twice by default.

    None without such meshes, or if MuJoCo refuses one: its surface is open, or inside out.
    """
    spec = spec.copy()
    counted = [mesh for mesh in spec.meshes if mesh.inertia == mujoco.mjtMeshInertia.mjMESH_INERTIA_LEGACY]
    for mesh in counted:
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT
    return _compiled(spec) if counted else None


@lru_cache(1)
def without_visual(spec: Any) -> tuple[Any, Any] | None:
    """Without mass of geometries that collide with nothing, and of which the file gives no mass.

    Those of a body that has no other geometry keep theirs. None without such geometries.
    """
    spec, changed = spec.copy(), False
    for body in spec.bodies:
        visual = [geom for geom in body.geoms if not (geom.contype or geom.conaffinity or spec.pairs)]
        for geom in visual if len(visual) < len(body.geoms) else ():
            changed = changed or math.isnan(geom.mass)
            geom.mass = 0.0 if math.isnan(geom.mass) else geom.mass
    return _compiled(spec) if changed else None


@lru_cache(CHANGED)
def without_mass_of(spec: Any, geom: int) -> tuple[Any, Any] | None:
    """Without the mass of a geometry."""
    spec = spec.copy()
    spec.geoms[geom].mass = 0.0
    return _compiled(spec)


def _compiled(spec: Any) -> tuple[Any, Any] | None:
    """The model of a specification, with its data; None if MuJoCo refuses it."""
    with suppress(ValueError), quiet():
        return placed(spec.compile())
    return None

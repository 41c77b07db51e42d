"""A model file as MuJoCo compiles it without some of what changes masses and inertias."""

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache, cached_property
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
}
"""Settings of the compiler that change masses and possible inertias of a file, with the values at which they change none."""


class Recompiled:
    """The models, with their data, that follow from a specification by changes; None if MuJoCo refuses one.

    Args:
        spec: The specification; it is not changed.
    """

    def __init__(self, spec: Any) -> None:
        self._spec = spec

    @cached_property
    def without(self) -> Callable[..., tuple[Any, Any] | None]:
        """The function from settings of the compiler to the model without their effect, made once; impossible inertias are balanced."""
        return cache(self._without)

    def _without(self, *settings: str) -> tuple[Any, Any] | None:
        spec = self._spec.copy()
        spec.compiler.balanceinertia = True
        for name in settings:
            setattr(spec.compiler, name, NEUTRAL[name])
        return _compiled(spec)

    @cached_property
    def exact(self) -> tuple[Any, Any] | None:
        """With exact volumes of meshes, of which MuJoCo counts parts twice by default.

        None without such meshes, or if MuJoCo refuses one: its surface is open, or inside out.
        """
        spec = self._spec.copy()
        counted = [mesh for mesh in spec.meshes if mesh.inertia == mujoco.mjtMeshInertia.mjMESH_INERTIA_LEGACY]
        for mesh in counted:
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT
        return _compiled(spec) if counted else None

    @cached_property
    def without_visual(self) -> tuple[Any, Any] | None:
        """Without mass of geometries that collide with nothing, and of which the file gives no mass.

        Those of a body that has no other geometry keep theirs. None without such geometries.
        """
        spec, changed = self._spec.copy(), False
        for body in spec.bodies:
            visual = [geom for geom in body.geoms if not (geom.contype or geom.conaffinity or spec.pairs)]
            for geom in visual if len(visual) < len(body.geoms) else ():
                changed = changed or math.isnan(geom.mass)
                geom.mass = 0.0 if math.isnan(geom.mass) else geom.mass
        return _compiled(spec) if changed else None


def _compiled(spec: Any) -> tuple[Any, Any] | None:
    """The model of a specification, with its data; None if MuJoCo refuses it."""
    with suppress(ValueError), quiet():
        return placed(spec.compile())
    return None

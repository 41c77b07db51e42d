"""The MuJoCo model of one body alone, with the options, the joint and the geometries of the compiled model of a file.

It has one contact pair for each geometry that may touch the surface, with the settings that MuJoCo mixes of both. y is up, and the surface
is the plane y = 0.
"""

import math
from collections.abc import Mapping
from copy import copy
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.diagnosis.geometries import VOLUMES
from dropspin.comparisons.diagnosis.loose_body import Changes
from dropspin.comparisons.diagnosis.mujoco_contacts import contact_of, overrides, plain, with_friction
from dropspin.comparisons.diagnosis.mujoco_file import BOX, GEOM, PLANE, MuJoCoFile, one_line
from dropspin.comparisons.diagnosis.mujoco_options import ELLIPTIC, set_options
from dropspin.comparisons.diagnosis.mujoco_shapes import MODELLED, kind_of, mesh_of, quaternion, shape_of
from dropspin.comparisons.engines.base import Diverged
from dropspin.comparisons.engines.mujoco_settings import OF_GEOM
from dropspin.comparisons.running.driving import Breakdown
from dropspin.scenarios.rotations import about, multiply, rotate, unrotate
from dropspin.scenarios.state import UP, Array
from dropspin.scenarios.truths.soft_rest import GeomSettings, SoftContact

FLAGS = mujoco.mjtDisableBit
NO_DAMPER = int(getattr(FLAGS, "mjDSBL_DAMPER", getattr(FLAGS, "mjDSBL_PASSIVE", 0)))
"""The flag that disables dampers, in older versions with all passive forces."""
OF_CONTACT = ("solref", "solimp", "solreffriction", "friction")
"""Settings of a contact that may be changed, as texts."""
WIDE = 100.0
"""Half the width of a box that a body lands on [m]."""
OFF_CENTRE = np.array([0.37, 0.0, 0.23])
"""From the body to the centre of this box [m]: if one is above the other, contacts of convex shapes may jump from corner to corner."""


class MuJoCoAlone:
    """A body, with what is welded to it, and the surface.

    Args:
        file: The file.
        name: The body's name.
        on: The name of the geometry that it lands on; by default the plane or box of the world below it that it collides with.

    Attributes:
        head: The number of the body in the file's model.
        group: The numbers of what is welded to it, its own first.
        geoms: The numbers of their geometries, in which order the model alone has them too.
        names: The names of all geometries of the file.
        surface: The number of what it lands on; None for nothing.
        others: The numbers of what else it collides with and may land on, unless what it lands on was named.
        missed: A plane of the file that it falls through, and why; empty if there is none.
        left_out: What it collides with in place of the added plane; empty if there is nothing, or what it lands on was named.
        between: What it collides with above what it lands on; empty if there is nothing, or what it lands on was named.
        pairs: The settings of the contacts with it, by geometry.
        dof: The number of the first degree of freedom of the free joint; None without one.
    """

    def __init__(self, file: MuJoCoFile, name: str, on: str | None) -> None:
        self.file, old = file, file.model
        self.head = file.heads[name]
        self.group = file.group(self.head)
        self.geoms = [geom for geom in range(old.ngeom) if old.geom_bodyid[geom] in self.group]
        self.names = list(file.names(GEOM))
        for geom in self.geoms:
            if (kind := kind_of(old, geom)) not in MODELLED:
                raise Breakdown("declined", f"its geometry {self.names[geom]!r} is a {kind}; give it as primitives or meshes")
        surfaces = file.surfaces(on, self.geoms)
        self.surface, self.others = next(iter(surfaces), None), surfaces[1:]
        self.missed = file.missed(self.geoms)
        self.left_out = file.left_out(self.geoms) if on is None else ""
        self.between = file.between(self.geoms, self.surface) if on is None and self.surface is not None and not self.left_out else ""
        self.pairs: dict[int, dict[str, Any]] = {}
        if self.surface is not None and file.has_contacts:
            contacts = {geom: contact_of(old, geom, self.surface) for geom in self.geoms}
            self.pairs = {geom: contact for geom, contact in contacts.items() if contact is not None}
        joint = old.body_jntadr[self.head]
        is_free = joint >= 0 and old.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
        self.dof = int(old.jnt_dofadr[joint]) if is_free else None
        self._changes: Changes = {}
        self._models: dict[Any, Any] = {}
        if (old.body_gravcomp[self.group] < 0.0).any():
            why = "its gravcomp is negative, which MuJoCo uses only beside a body with a positive one; give one of 0 or more"
            raise Breakdown("declined", why)
        if (self.damping < 0.0).any():
            raise Breakdown("declined", "the damping of its joint is negative, with which it gains speed; give one of 0 or more")

    def changed(self, changes: Changes) -> "MuJoCoAlone":
        """The same with other settings."""
        new = copy(self)
        new._changes, new._models = changes, {}
        return new

    def model(self, dt: float, gravity: Array, *, floor: bool) -> Any:
        """The model, compiled once for each set of arguments.

        Args:
            dt: Time step [s].
            gravity: Acceleration [m/s²], shape (3,).
            floor: Whether the surface is there.
        """
        key = (dt, tuple(gravity), floor)
        if key not in self._models:
            spec = mujoco.MjSpec()
            set_options(spec.option, self.file.model.opt, dt, self._changes)
            spec.option.gravity = gravity
            spec.option.wind = rotate(self.level, np.array(spec.option.wind))
            spec.compiler.degree = False
            for name in overrides(self.file.model) if self.pairs else ():  # which count instead of the pairs' settings
                setattr(spec.option, f"o_{name}", self.in_force_of(next(iter(self.pairs)))[name])
            self._add_bodies(spec)
            if floor:
                self._add_surface(spec)
            try:
                self._models[key] = spec.compile()
            except ValueError as error:  # as of a flag that needs the integrator of the file
                raise Diverged(f"MuJoCo refuses these options: {one_line(error)}") from None
        return self._models[key]

    def _add_bodies(self, spec: Any) -> None:
        """The body, with what is welded to it, and its joint."""
        old = self.file.model
        places: dict[int, Any] = {}
        for body in self.group:
            is_head = body == self.head
            parent = spec.worldbody if is_head else places[old.body_parentid[body]]
            at = {} if is_head else {"pos": old.body_pos[body], "quat": old.body_quat[body]}
            new = places[body] = parent.add_body(gravcomp=self._changes.get("gravcomp", old.body_gravcomp[body]), **at)
            if is_head:
                joint = new.add_freejoint()
                joint.damping, joint.armature = self.damping, self.armature
                if self.dof is not None and "frictionloss" not in self._changes:
                    joint.frictionloss = old.dof_frictionloss[self.dof]
            moments, weights = np.array(old.body_inertia[body]), dict.fromkeys(self.geoms, 0.0)
            if old.body_mass[body] > 0.0 and not moments.any():  # which MuJoCo simulates no body with
                weights |= self._spread(body)
            elif old.body_mass[body] > 0.0:
                largest = int(np.argmax(moments))
                moments[largest] = min(moments[largest], np.nextafter(moments.sum() - moments[largest], 0.0))
                new.explicitinertial, new.mass, new.inertia = True, old.body_mass[body], moments
                new.ipos, new.iquat = old.body_ipos[body], old.body_iquat[body]
            for number, geom in enumerate(self.geoms):
                if old.geom_bodyid[geom] == body:
                    new.add_geom(mass=weights[geom], name=f"own {number}", contype=0, conaffinity=0, **self._geom(spec, geom))

    def _spread(self, body: int) -> dict[int, float]:
        """The mass of a body, spread evenly over its geometries [kg]."""
        old = self.file.model
        shapes = {geom: shape_of(old, geom)[0] for geom in self.geoms if old.geom_bodyid[geom] == body}
        volumes = {geom: VOLUMES[shape.shape](shape) for geom, shape in shapes.items()}
        if not sum(volumes.values()) > 0.0:
            raise Breakdown("declined", "it has mass, and neither moments of inertia nor a solid geometry")
        return {geom: float(old.body_mass[body]) * volume / sum(volumes.values()) for geom, volume in volumes.items()}

    @property
    def damping(self) -> Array:
        """The coefficients of the joint's damping, of |v| to the powers 0, 1 and 2."""
        old = self.file.model
        if self.dof is None or "damping" in self._changes or old.opt.disableflags & NO_DAMPER:
            return np.zeros(3)
        return np.array([old.dof_damping[self.dof], *getattr(old, "dof_dampingpoly", np.zeros((old.nv, 2)))[self.dof]])

    @property
    def armature(self) -> float:
        """What the joint adds to the mass [kg] and to each moment of inertia [kg m²]."""
        is_there = self.dof is not None and "armature" not in self._changes
        return float(self.file.model.dof_armature[self.dof]) if is_there else 0.0

    def _geom(self, spec: Any, geom: int) -> dict[str, Any]:
        """What a geometry is and where, as the compiled model has it."""
        old = self.file.model
        found = {"type": old.geom_type[geom], "size": old.geom_size[geom], "pos": old.geom_pos[geom], "quat": old.geom_quat[geom]}
        found |= {"fluid_ellipsoid": int(old.geom_fluid[geom, 0]), "fluid_coefs": old.geom_fluid[geom, 1:6]}
        if old.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
            return found
        points, faces = mesh_of(old, geom)
        name = f"mesh {self.geoms.index(geom)}"
        mesh = spec.add_mesh(name=name, uservert=points.ravel(), userface=faces.ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        return found | {"meshname": name}

    def _add_surface(self, spec: Any) -> None:
        """What the body lands on, level and with its top at y = 0, and the contact pairs; a box is so wide that no body leaves it."""
        file, old = self.file, self.file.model
        assert self.surface is not None
        turn = multiply(self.level, quaternion(file.data.geom_xmat[self.surface]))
        at: dict[str, Any] = {"pos": np.zeros(3), "quat": np.roll(turn, 1)}
        if old.geom_type[self.surface] == BOX:
            half = float(old.geom_size[self.surface] @ np.abs(unrotate(turn, UP)))
            at = {"pos": OFF_CENTRE - half * UP, "quat": [1.0, 0.0, 0.0, 0.0], "size": [WIDE, half, WIDE]}
        spec.worldbody.add_geom(name="surface", contype=0, conaffinity=0, **self._geom(spec, self.surface) | at)
        for geom in self.pairs:
            spec.add_pair(geomname1="surface", geomname2=f"own {self.geoms.index(geom)}", **self.in_force_of(geom))

    def in_force_of(self, geom: int) -> dict[str, Any]:
        """The settings in force of the contact of a geometry, with the time constant that MuJoCo raises to two time steps.

        Of the file, whatever step is simulated: as dt → 0 the contact stays the same. Of another step if that is tried as a remedy.
        """
        pair = self.pairs[geom]
        changed = {name: np.array(str(self._changes[name]).split(), float) for name in OF_CONTACT if name in self._changes}
        if "friction" in changed:  # for a slide
            changed |= with_friction(pair, self._changes["friction"])
        dimensions = {"condim": self._changes["condim"]} if "condim" in self._changes else {}
        still = {"margin": 0.0, "gap": 0.0} if "margin" in self._changes else {}
        return pair | {"solref": self.clamped(pair)} | changed | still | dimensions

    def clamped(self, pair: Mapping[str, Any]) -> Array:
        """The time constant and the damping ratio that are in force at the time step of the file, or of a remedy."""
        (constant, ratio), dt = pair["solref"], float(self._changes.get("timestep", self.file.model.opt.timestep))
        return np.array([max(constant, 2.0 * dt) if constant > 0.0 and self.file.is_safe else constant, ratio])

    @property
    def contact(self) -> SoftContact | None:
        """The contact of a body with one contact pair."""
        if len(self.pairs) != 1:
            return None
        touching = self.in_force_of(*self.pairs)
        option = self.model(self.file.model.opt.timestep, np.zeros(3), floor=False).opt
        friction = tuple(touching["friction"][OF_GEOM].tolist())
        names = ("solref", "solimp", "condim", "margin")
        settings = GeomSettings(friction=friction, **{name: plain(np.asarray(touching[name])) for name in names})
        return SoftContact(settings, option.cone == ELLIPTIC, option.impratio, option.timestep if self.file.is_safe else 0.0)

    @property
    def gravity_angle(self) -> float:
        """The angle between gravity and the direction into the surface [°]."""
        x, y, z = rotate(self.level, self.file.gravity)
        return math.degrees(math.atan2(math.hypot(x, z), -y)) if self.file.gravity.any() else 0.0

    @cached_property
    def level(self) -> Array:
        """The rotation from the file's world to one in which the surface is level, or gravity vertical, and y is up."""
        file, old = self.file, self.file.model
        g = file.gravity
        up = -g / np.linalg.norm(g) if g.any() else np.array([0.0, 0.0, 1.0])
        if self.surface is not None:
            axes = file.data.geom_xmat[self.surface].reshape(3, 3).T
            up = axes[2] if old.geom_type[self.surface] == PLANE else max((*axes, *-axes), key=lambda axis: float(axis @ up))
        axis = np.cross(up, UP)
        sine = np.linalg.norm(axis)
        return about(axis / sine if sine else np.array([1.0, 0.0, 0.0]), np.arctan2(sine, up @ UP))

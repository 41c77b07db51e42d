"""A free body of a file that MuJoCo compiles, simulated alone, with the values that the compiled model has.

It has a model of its own, with the options, the joint and the geometries of the compiled model, and one contact pair for each geometry that
may touch the surface, with the settings that MuJoCo mixes of both.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout

from dropspin.comparisons.diagnosis.loose_body import Changes, Drag, Facts, LooseBody, Part, Support
from dropspin.comparisons.diagnosis.mujoco_file import BOX, ELLIPTIC, GEOM, OPTIONS, PLANE, RK4, MuJoCoFile, plain, set_options
from dropspin.comparisons.diagnosis.mujoco_shapes import MODELLED, mesh_of, quaternion, shape_of
from dropspin.comparisons.diagnosis.mujoco_text import BodyText
from dropspin.comparisons.engines.base import Diverged
from dropspin.comparisons.engines.mujoco_simulation import FULL_STATE, quiet
from dropspin.comparisons.running.recording import Breakdown
from dropspin.scenarios.rotations import about, cross, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.truths.settings import joint_damping
from dropspin.scenarios.truths.soft_rest import GeomSettings, SoftContact

UNMODELLED = {
    "neq": "equality constraints",
    "ntendon": "tendons",
    "nu": "actuators",
    "nflex": "flexible bodies",
    "flg_surfacevel": "surface velocities",
    "flg_adhesion": "adhesion of geometries",
}
FLAT = 1e-9
"""Depth, relative to the size, at which contacts are counted."""


class MuJoCoModel(MuJoCoFile):
    """A model of which bodies can be simulated alone."""

    def body(self, name: str, on: str | None) -> LooseBody:
        """A body above what it lands on."""
        return MuJoCoBody(self, name, on, {})


class MuJoCoBody(LooseBody):
    """A free body, or a link that is cut loose, with what is welded to it.

    Args:
        file: The file.
        name: The body's name.
        on: The name of the geometry that it lands on; by default the first plane or box of the world that it collides with.
        changes: Settings that differ from those of the file.
    """

    def __init__(self, file: MuJoCoFile, name: str, on: str | None, changes: Changes) -> None:
        self._given, self._changes = (file, name, on), changes
        self._file, old, self._head = file, file.model, file.heads[name]
        self._group = file.group(self._head)
        self._geoms = [geom for geom in range(old.ngeom) if old.geom_bodyid[geom] in self._group]
        for geom in self._geoms:
            if int(old.geom_type[geom]) not in map(int, MODELLED):
                kind = mujoco.mjtGeom(int(old.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
                raise Breakdown("declined", f"its geometry {self._names[geom]!r} is of the type {kind}, which is not modelled")
        self._surface = file.surface(on, self._geoms)
        self._text = BodyText(file, self._head, self._surface)
        self._pairs: dict[int, dict[str, Any]] = {}
        if self._surface is not None and file.has_contacts:
            contacts = {geom: file.contact(geom, self._surface) for geom in self._geoms}
            self._pairs = {geom: contact for geom, contact in contacts.items() if contact is not None}
        joint = old.body_jntadr[self._head]
        is_free = joint >= 0 and old.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
        self._dof = int(old.jnt_dofadr[joint]) if is_free else None
        self._models: dict[Any, Any] = {}
        self._offset = np.zeros(3)
        self._alone = self._built(old.opt.timestep, np.zeros(3), False)
        self._offset, inertia = self._mass_properties()
        self.facts = self._facts(name, inertia)
        self.remedies = {
            "damping": ({"damping": 0.0}, "<freejoint/>"),
            "armature": ({"armature": 0.0}, 'armature="0"'),
            "integrator": ({"integrator": RK4}, '<option integrator="RK4"/>'),
            "cone": ({"cone": ELLIPTIC}, '<option cone="elliptic"/>'),
            "impratio": ({"cone": ELLIPTIC, "impratio": 10.0}, '<option cone="elliptic" impratio="10"/>'),
            "margin": ({"margin": 0.0}, 'margin="0"'),
            "frictionloss": ({"frictionloss": 0.0}, 'frictionloss="0"'),
            "density": ({"density": 0.0, "viscosity": 0.0}, '<option density="0" viscosity="0"/>'),
        }
        self.remedies["viscosity"] = self.remedies["density"]

    def changed(self, changes: Changes) -> LooseBody:
        return MuJoCoBody(*self._given, changes)

    def elsewhere(self, dt: float, changes: Changes) -> tuple[int, bool]:
        old = self._file.model
        is_global = dt != old.opt.timestep or any(name in OPTIONS for name in changes)
        others = [body for body in self._file.heads.values() if body != self._head] if is_global else []
        return len(others), not is_global or self._file.runs(dt, changes)

    def motions(self, starts: Array, dt: float, steps: int, gravity: Array, *, floor: bool) -> Array:
        model = self._built(dt, gravity, floor)
        data = mujoco.MjData(model)
        mujoco.mj_resetData(model, data)
        first = np.empty((len(starts), mujoco.mj_stateSize(model, FULL_STATE)))
        mujoco.mj_getState(model, data, first[0], FULL_STATE)
        first[:] = first[0]
        arms = rotate(starts[:, ORIENTATION], self._offset)
        first[:, 1:4] = starts[:, POSITION] - arms
        first[:, 4:8] = np.roll(starts[:, ORIENTATION], 1, axis=1)
        first[:, 8:11] = starts[:, VELOCITY] - cross(starts[:, SPIN], arms)
        first[:, 11:14] = unrotate(starts[:, ORIENTATION], starts[:, SPIN])
        rows = np.empty((len(starts), 1 + steps, first.shape[1]))
        rows[:, 0] = first
        if steps:
            with quiet():
                rows[:, 1:], _ = rollout.rollout(model, data, first, nstep=steps)
        if any(warning.number for warning in data.warning[-3:]) or not np.isfinite(rows).all():
            raise Diverged(f"MuJoCo's state became NaN or too large within {steps} steps of {dt:g} s")
        found = np.empty((*rows.shape[:2], 13))
        found[..., ORIENTATION] = np.roll(rows[..., 4:8], -1, axis=-1)
        arms = rotate(found[..., ORIENTATION], np.broadcast_to(self._offset, (*rows.shape[:2], 3)))
        found[..., SPIN] = rotate(found[..., ORIENTATION], rows[..., 11:14])
        found[..., POSITION] = rows[..., 1:4] + arms
        found[..., VELOCITY] = rows[..., 8:11] + cross(found[..., SPIN], arms)
        return found

    def _built(self, dt: float, gravity: Array, floor: bool) -> Any:
        """The model of the body alone, compiled once for each set of arguments."""
        key = (dt, tuple(gravity), floor)
        if key not in self._models:
            spec = mujoco.MjSpec()
            set_options(spec.option, self._file.model.opt, dt, self._changes)
            spec.option.gravity = gravity
            spec.option.wind = rotate(self._level, self._file.model.opt.wind)
            spec.compiler.degree = False
            self._add_bodies(spec)
            if floor:
                self._add_surface(spec)
            self._models[key] = spec.compile()
        return self._models[key]

    def _add_bodies(self, spec: Any) -> None:
        """The body, with what is welded to it, and its joint."""
        old = self._file.model
        places: dict[int, Any] = {}
        for body in self._group:
            is_head = body == self._head
            parent = spec.worldbody if is_head else places[old.body_parentid[body]]
            at = {} if is_head else {"pos": old.body_pos[body], "quat": old.body_quat[body]}
            new = places[body] = parent.add_body(gravcomp=old.body_gravcomp[body], **at)
            if is_head:
                joint = new.add_freejoint()
                joint.damping, joint.armature = self._damping, self._armature
                if self._dof is not None and "frictionloss" not in self._changes:
                    joint.frictionloss = old.dof_frictionloss[self._dof]
            if old.body_mass[body] > 0.0:
                moments = np.array(old.body_inertia[body])
                largest = int(np.argmax(moments))
                moments[largest] = min(moments[largest], np.nextafter(moments.sum() - moments[largest], 0.0))
                new.explicitinertial, new.mass, new.inertia = True, old.body_mass[body], moments
                new.ipos, new.iquat = old.body_ipos[body], old.body_iquat[body]
            for geom in self._geoms:
                if old.geom_bodyid[geom] == body:
                    new.add_geom(mass=0.0, name=f"own {geom}", contype=0, conaffinity=0, **self._geom(spec, geom))

    @property
    def _damping(self) -> Array:
        """The coefficients of the joint's damping, of |v| to the powers 0, 1 and 2."""
        old = self._file.model
        if self._dof is None or "damping" in self._changes:
            return np.zeros(3)
        return np.array([old.dof_damping[self._dof], *getattr(old, "dof_dampingpoly", np.zeros((old.nv, 2)))[self._dof]])

    @property
    def _armature(self) -> float:
        """What the joint adds to the mass [kg] and to each moment of inertia [kg m²]."""
        is_there = self._dof is not None and "armature" not in self._changes
        return float(self._file.model.dof_armature[self._dof]) if is_there else 0.0

    def _geom(self, spec: Any, geom: int) -> dict[str, Any]:
        """What a geometry is and where, as the compiled model has it."""
        old = self._file.model
        found = {"type": old.geom_type[geom], "size": old.geom_size[geom], "pos": old.geom_pos[geom], "quat": old.geom_quat[geom]}
        found |= {"fluid_ellipsoid": int(old.geom_fluid[geom, 0]), "fluid_coefs": old.geom_fluid[geom, 1:6]}
        if old.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
            return found
        points, faces = mesh_of(old, geom)
        mesh = spec.add_mesh(name=f"mesh {geom}", uservert=points.ravel(), userface=faces.ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        return found | {"meshname": f"mesh {geom}"}

    def _add_surface(self, spec: Any) -> None:
        """What the body lands on, level and with its top at y = 0, and the contact pairs."""
        file, old = self._file, self._file.model
        assert self._surface is not None
        turn = multiply(self._level, quaternion(file.data.geom_xmat[self._surface]))
        top = old.geom_size[self._surface] @ np.abs(unrotate(turn, UP)) if old.geom_type[self._surface] == BOX else 0.0
        at = {"pos": -top * UP, "quat": np.roll(turn, 1)}
        spec.worldbody.add_geom(name="surface", contype=0, conaffinity=0, **self._geom(spec, self._surface) | at)
        for geom, pair in self._pairs.items():
            spec.add_pair(geomname1="surface", geomname2=f"own {geom}", **self._in_force(pair))

    def _in_force(self, pair: Mapping[str, Any]) -> dict[str, Any]:
        """The settings of a contact, with the time constant that MuJoCo raises to two of the file's steps."""
        return dict(pair) | {"solref": self._clamped(pair)} | ({"margin": 0.0, "gap": 0.0} if "margin" in self._changes else {})

    def _clamped(self, pair: Mapping[str, Any]) -> Array:
        """The time constant and the damping ratio that are in force at the file's time step."""
        option, (constant, ratio) = self._file.model.opt, pair["solref"]
        is_safe = not option.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE
        return np.array([max(constant, 2.0 * option.timestep) if constant > 0.0 and is_safe else constant, ratio])

    @cached_property
    def _level(self) -> Array:
        """The rotation from the file's world to one in which the surface is level, or gravity vertical, and y is up."""
        file, old = self._file, self._file.model
        g = file.gravity
        up = -g / np.linalg.norm(g) if g.any() else np.array([0.0, 0.0, 1.0])
        if self._surface is not None:
            axes = file.data.geom_xmat[self._surface].reshape(3, 3).T
            up = axes[2] if old.geom_type[self._surface] == PLANE else max((*axes, *-axes), key=lambda axis: float(axis @ up))
        axis = np.cross(up, UP)
        sine = np.linalg.norm(axis)
        return about(axis / sine if sine else np.array([1.0, 0.0, 0.0]), np.arctan2(sine, up @ UP))

    def _mass_properties(self) -> tuple[Array, Array]:
        """The centre of mass in the frame of the body [m], and the inertia about it [kg m²], of the body and what is welded to it."""
        model, data = self._alone, self._at_rest
        masses, points = model.body_mass[1:], data.xipos[1:]
        centre = np.average(points, axis=0, weights=masses)
        inertia = np.zeros((3, 3))
        for mass, moments, axes, arm in zip(masses, model.body_inertia[1:], data.ximat[1:], points - centre, strict=True):
            turn = axes.reshape(3, 3)
            inertia += turn @ np.diag(moments) @ turn.T + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return centre, inertia

    @cached_property
    def _at_rest(self) -> Any:
        data = mujoco.MjData(self._alone)
        data.qpos[:] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        mujoco.mj_kinematics(self._alone, data)
        return data

    def _facts(self, name: str, inertia: Array) -> Facts:
        file, old = self._file, self._file.model
        raised = any(not np.array_equal(self._clamped(pair), pair["solref"]) for pair in self._pairs.values())
        drag, head = Drag(*self._damping[:2]), self._head
        pose = multiply(self._level, np.roll(file.data.xquat[head], -1))
        touching = next(map(self._in_force, self._pairs.values()), None)
        return Facts(
            name=name,
            engine=f"MuJoCo {mujoco.__version__}",
            dt=old.opt.timestep,
            gravity=float(np.linalg.norm(file.gravity)),
            mass=float(old.body_mass[self._group].sum()),
            inertia=inertia,
            offset=self._offset,
            parts=self._parts,
            pose=pose,
            resistance=joint_damping(*self._damping),
            falls=drag,
            spins=(drag, drag, drag),
            armature=self._armature,
            lifted=float(old.body_gravcomp[head]),
            unknown=self._unknown_forces(),
            surface="" if touching is None or self._surface is None else self._names[self._surface],
            friction=0.0 if touching is None or touching["condim"] == 1 else float(touching["friction"][0]),
            restitution=None,
            margin=0.0 if touching is None else float(touching["margin"] - touching["gap"]),
            rolling=touching is not None and touching["condim"] == 6 and bool(np.any(touching["friction"][3:])),
            rest_depth=self._rest_depth(touching, pose),
            written=self._text.written,
            settings=self._text.settings,
            ignored=list(self._text.ignored(inertia, raised=raised)),
            unmodelled=[words for field, words in UNMODELLED.items() if getattr(old, field, 0)],
        )

    @cached_property
    def _parts(self) -> list[Part]:
        return [self._part(geom) for geom in range(self._alone.ngeom)]

    def _part(self, number: int) -> Part:
        """A geometry as a shape, relative to the centre of mass."""
        model, data = self._alone, self._at_rest
        shape, shift, turned = shape_of(model, number)
        turn = quaternion(data.geom_xmat[number])
        position = data.geom_xpos[number] - self._offset + rotate(turn, shift)
        geom = int(model.geom(number).name.split()[1])
        return Part(self._names[geom], shape, position, multiply(turn, turned), not self._pairs or geom in self._pairs)

    @cached_property
    def _names(self) -> list[str]:
        return list(self._file.names(GEOM, self._file.model.ngeom))

    def _unknown_forces(self) -> tuple[str, ...]:
        """The settings of a fluid and of dry friction in the joint."""
        alone = self._alone
        found = ["frictionloss"] * bool(alone.dof_frictionloss.any())
        return (*found, *(name for name in ("density", "viscosity") if getattr(alone.opt, name) > 0.0))

    def _rest_depth(self, touching: Mapping[str, Any] | None, pose: Array) -> float:
        """The depth of a body that rests on one point, or on several that share its weight, below the surface [m]; NaN of others."""
        points = 0 if touching is None else self._points(pose)
        if not points or touching is None:
            return np.nan
        option = self._alone.opt
        friction = tuple(touching["friction"][[0, 2, 3]].tolist())
        names = ("solref", "solimp", "condim", "margin")
        settings = GeomSettings(friction=friction, **{name: plain(np.asarray(touching[name])) for name in names})
        is_safe = not option.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE
        contact = SoftContact(settings, option.cone == ELLIPTIC, option.impratio, option.timestep if is_safe else 0.0)
        mass = float(self._alone.body_mass.sum())
        return contact.depth(float(np.linalg.norm(self._file.gravity)) * mass / (mass + self._armature) / points) - settings.margin

    def _points(self, pose: Array) -> int:
        """The number of contacts in a pose that share the weight evenly; 0 if they do not, or have different settings."""
        if len(self._pairs) != 1 or (self._armature and self._offset.any()):
            return 0
        model = self._built(self._file.model.opt.timestep, np.zeros(3), True)
        data, size = mujoco.MjData(model), float(model.stat.extent)
        parts = [part for part in self._parts if part.collides]
        data.qpos[:] = [*(-rotate(pose, self._offset)), *np.roll(pose, 1)]
        data.qpos[1] -= Support(parts).lowest(np.concatenate([np.zeros(3), pose, np.zeros(6)])[np.newaxis])[0] + FLAT * size
        with quiet():
            mujoco.mj_forward(model, data)
        places = data.contact.pos[:, [0, 2]]
        is_even = len(places) > 0 and bool(np.abs(places.mean(axis=0)).max() < 1e-6 * size)
        return len(places) if is_even and np.ptp(np.linalg.norm(places, axis=1)) < 1e-6 * size else 0

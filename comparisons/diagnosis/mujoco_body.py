"""Free bodies of MJCF and URDF files that MuJoCo compiles, with the values that the compiled model has.

A body is simulated alone: in a model of its own, with the options, the joint and the geometries of the compiled model, and one contact pair
for each geometry that may touch the surface, with the settings that MuJoCo mixes of both.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout

from dropspin.comparisons.diagnosis.loose_body import Changes, Drag, Facts, LooseBody, Part, lowest, mesh_shape
from dropspin.comparisons.diagnosis.source import Element, Setting, mjcf_setting, option_setting, read_source
from dropspin.comparisons.engines.base import Diverged
from dropspin.comparisons.engines.mujoco_simulation import FULL_STATE, quiet
from dropspin.scenarios import DropspinError
from dropspin.scenarios.bodies import Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere
from dropspin.scenarios.errors import UnknownName
from dropspin.scenarios.rotations import about, cross, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.truths.settings import joint_damping
from dropspin.scenarios.truths.soft_rest import GeomSettings, SoftContact, mixed

BODY, GEOM = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_GEOM
PLANE, BOX = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX
SURFACES = (PLANE, BOX)
"""The kinds of geometries that a body may land on."""
INTEGRATORS = {"Euler": 0, "RK4": 1, "implicit": 2, "implicitfast": 3}
CONES = {"pyramidal": 0, "elliptic": 1}
OPTIONS = [name for name in dir(mujoco.MjSpec().option) if not name.startswith("_")]
UPWARD = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0])
"""The rotation [w, x, y, z] that takes z to y."""
ADDED = "a plane with default settings"
"""The surface of a file that has none."""
FLAT = 1e-9
"""Depth, relative to the size, at which contacts are counted."""
SAME = 1e-6
"""Relative difference up to which a moment of inertia is the one that was written."""
UNMODELLED = {"neq": "equality constraints", "ntendon": "tendons", "nu": "actuators", "nflex": "flexible bodies"}
CHANGED_BY = ("balanceinertia", "boundinertia", "boundmass", "settotalmass", "inertiafromgeom")
"""Settings of the compiler that change the inertia of a file."""


class MuJoCoModel:
    """A model file as MuJoCo compiles it.

    Args:
        path: The MJCF or URDF file.
        given: Its name for messages.

    Raises:
        DropspinError: MuJoCo does not compile it.
    """

    def __init__(self, path: Path, given: str) -> None:
        self.source = read_source(path)
        self.is_urdf = self.source.tag == "robot"
        self.refusal = ""
        try:
            self._spec = mujoco.MjSpec.from_file(str(path))
            if self.is_urdf:  # the root link would become a part of the world
                self._spec.compiler.fusestatic = False
            self._spec.worldbody.add_geom(name=ADDED, type=PLANE, size=[0.0, 0.0, 1.0])
            try:
                self.model = self._spec.compile()
            except ValueError as error:
                if "balanceinertia" not in str(error):
                    raise
                self.refusal, self._spec.compiler.balanceinertia = one_line(error), True
                self.model = self._spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise DropspinError(f"{given}: MuJoCo does not compile it: {one_line(error)}.") from None
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)

    def names(self, kind: Any, number: int) -> dict[str, int]:
        """The numbers of objects by name; one without a name is called by its kind and number."""
        what = "body" if kind == BODY else "geom"
        return {mujoco.mj_id2name(self.model, kind, one) or f"{what} {one}": one for one in range(number)}

    @cached_property
    def heads(self) -> dict[str, int]:
        """The bodies that move against their parents, by name; of a URDF file, whose root is welded to the world, that too."""
        welded, bodies = self.model.body_weldid, self.names(BODY, self.model.nbody)
        static = [body for body in bodies.values() if body and welded[body] == 0]
        found = {name: body for name, body in bodies.items() if body and welded[body] == body}
        return {name: body for name, body in bodies.items() if body in static[:1]} | found if self.is_urdf else found

    def bodies(self, wanted: Sequence[str], loose: bool) -> list[str]:
        """The names of the bodies that are free, or that are asked for, or of all that move.

        Raises:
            UnknownName: There is no such body.
            DropspinError: No body is free.
        """
        for name in wanted:
            if name not in self.heads:
                raise UnknownName("the model's body", name, self.heads)
        heavy = [name for name, body in self.heads.items() if sum(self.model.body_mass[one] for one in self.group(body)) > 0.0]
        found = wanted or [name for name in heavy if loose or self.is_free(self.heads[name]) or (self.is_urdf and len(heavy) == 1)]
        if not found:
            there = f"the bodies {', '.join(heavy)} move on joints" if heavy else "no body moves"
            raise DropspinError(f"no body is free: {there}; name one with --body, or give --loose to cut each loose.")
        return list(found)

    def body(self, name: str, on: str | None) -> LooseBody:
        """A body above what it lands on; its simulations write nothing to the model."""
        return MuJoCoBody(self, name, on, {})

    def runs(self, dt: float, changes: Changes) -> bool:
        """Whether the whole model runs for a tenth of a second with other options."""
        spec = self._spec.copy()
        set_options(spec.option, self.model.opt, dt, changes)
        model = spec.compile()
        data = mujoco.MjData(model)
        with quiet():
            mujoco.mj_step(model, data, math.ceil(0.1 / dt))
        return not any(warning.number for warning in data.warning[-3:])

    def group(self, head: int) -> list[int]:
        """A body and what is welded to it."""
        welded = self.model.body_weldid
        return [body for body in range(1, self.model.nbody) if welded[body] == welded[head] and body >= head]

    def is_free(self, body: int) -> bool:
        """Whether a body has a free joint, and nothing is jointed to it."""
        model = self.model
        has_joint = model.body_jntnum[body] == 1 and model.jnt_type[model.body_jntadr[body]] == mujoco.mjtJoint.mjJNT_FREE
        return bool(has_joint and np.sum(model.body_rootid == body) == len(self.group(body)))

    def surface(self, wanted: str | None, own: Sequence[int]) -> int | None:
        """The geometry that some geometries land on: the one named, or the first plane or else box of the world that they collide with.

        Raises:
            DropspinError: There is no such geometry, or it is neither a plane nor a box.
        """
        model = self.model
        others = {name: geom for name, geom in self.names(GEOM, model.ngeom).items() if geom not in own}
        if wanted is not None:
            if wanted not in others:
                raise UnknownName("the model's geometry", wanted, others)
            if int(model.geom_type[others[wanted]]) not in map(int, SURFACES):
                raise DropspinError(f"--on {wanted}: is neither a plane nor a box; name one of these.")
            return others[wanted]
        still = [geom for geom in others.values() if model.body_weldid[model.geom_bodyid[geom]] == 0]
        ranked = [geom for kind in SURFACES for geom in still if model.geom_type[geom] == kind and geom != others[ADDED]]
        return next((geom for geom in [*ranked, others[ADDED]] if any(self.contact(one, geom) for one in own)), None)

    def contact(self, first: int, second: int) -> dict[str, Any] | None:
        """The settings of a contact of two geometries, as MuJoCo mixes them; None if they do not collide."""
        model = self.model
        for pair in range(model.npair):
            if {model.pair_geom1[pair], model.pair_geom2[pair]} == {first, second}:
                names = ("friction", "solref", "solreffriction", "solimp", "margin", "gap")
                return {"condim": model.pair_dim[pair]} | {name: getattr(model, f"pair_{name}")[pair] for name in names}
        types, affinities = model.geom_contype, model.geom_conaffinity
        bodies = [model.geom_bodyid[geom] for geom in (first, second)]
        excluded = [(bodies[0] << 16) + bodies[1], (bodies[1] << 16) + bodies[0]]
        if not (types[first] & affinities[second] or types[second] & affinities[first]) or np.isin(model.exclude_signature, excluded).any():
            return None
        both = mixed(self._settings_of(first), self._settings_of(second))
        return {
            "condim": both.condim,
            "solref": np.array(both.solref),
            "solimp": np.array(both.solimp),
            "friction": np.array(both.friction)[[0, 0, 1, 2, 2]],
            "margin": both.margin,
            "gap": model.geom_gap[[first, second]].sum(),
        }

    def _settings_of(self, geom: int) -> GeomSettings:
        model, names = self.model, ("solref", "solimp", "friction", "condim", "margin", "priority", "solmix")
        return GeomSettings(**{name: _plain(getattr(model, f"geom_{name}")[geom]) for name in names})


def _plain(value: Any) -> Any:
    """Numbers of a compiled model as a tuple, or as a number."""
    return tuple(value.tolist()) if np.ndim(value) else value.item()


class MuJoCoBody(LooseBody):
    """A free body, or a link that is cut loose, with what is welded to it.

    Args:
        model: The model.
        name: The body's name.
        on: The name of the geometry that it lands on; by default the first plane or box of the world that it collides with.
        changes: Settings that differ from those of the file.
    """

    def __init__(self, model: MuJoCoModel, name: str, on: str | None, changes: Changes) -> None:
        self._given, self._changes = (model, name, on), changes
        self._model, old, self._head = model, model.model, model.heads[name]
        self._group = model.group(self._head)
        self._geoms = [geom for geom in range(old.ngeom) if old.geom_bodyid[geom] in self._group]
        self._surface = model.surface(on, self._geoms)
        pairs = {} if self._surface is None else {geom: model.contact(geom, self._surface) for geom in self._geoms}
        self._pairs = {geom: pair for geom, pair in pairs.items() if pair is not None}
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
            "integrator": ({"integrator": "RK4"}, '<option integrator="RK4"/>'),
            "cone": ({"cone": "elliptic"}, '<option cone="elliptic"/>'),
            "impratio": ({"cone": "elliptic", "impratio": 10.0}, '<option cone="elliptic" impratio="10"/>'),
            "margin": ({"margin": 0.0}, 'margin="0"'),
        }

    def changed(self, changes: Changes) -> LooseBody:
        return MuJoCoBody(*self._given, changes)

    def elsewhere(self, dt: float, changes: Changes) -> tuple[int, bool]:
        old = self._model.model
        is_global = dt != old.opt.timestep or any(name in OPTIONS for name in changes)
        others = [body for body in self._model.heads.values() if body != self._head] if is_global else []
        return len(others), not is_global or self._model.runs(dt, changes)

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
            set_options(spec.option, self._model.model.opt, dt, self._changes)
            spec.option.gravity = gravity
            spec.compiler.degree = False
            self._add_bodies(spec)
            if floor:
                self._add_surface(spec)
            self._models[key] = spec.compile()
        return self._models[key]

    def _add_bodies(self, spec: Any) -> None:
        """The body, with what is welded to it, and its joint."""
        old = self._model.model
        places: dict[int, Any] = {}
        for body in self._group:
            is_head = body == self._head
            parent = spec.worldbody if is_head else places[old.body_parentid[body]]
            at = {} if is_head else {"pos": old.body_pos[body], "quat": old.body_quat[body]}
            new = places[body] = parent.add_body(gravcomp=old.body_gravcomp[body], **at)
            if is_head:
                joint = new.add_freejoint()
                joint.damping, joint.armature = self._damping, self._armature
                if self._dof is not None:
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
        old = self._model.model
        if self._dof is None or "damping" in self._changes:
            return np.zeros(3)
        return np.array([old.dof_damping[self._dof], *getattr(old, "dof_dampingpoly", np.zeros((old.nv, 2)))[self._dof]])

    @property
    def _armature(self) -> float:
        """What the joint adds to the mass [kg] and to each moment of inertia [kg m²]."""
        is_there = self._dof is not None and "armature" not in self._changes
        return float(self._model.model.dof_armature[self._dof]) if is_there else 0.0

    def _geom(self, spec: Any, geom: int) -> dict[str, Any]:
        """What a geometry is and where, as the compiled model has it."""
        old = self._model.model
        found = {"type": old.geom_type[geom], "size": old.geom_size[geom], "pos": old.geom_pos[geom], "quat": old.geom_quat[geom]}
        if old.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
            return found
        points, faces = mesh_of(old, geom)
        mesh = spec.add_mesh(name=f"mesh {geom}", uservert=points.ravel(), userface=faces.ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        return found | {"meshname": f"mesh {geom}"}

    def _add_surface(self, spec: Any) -> None:
        """What the body lands on, level and with its top at y = 0, and the contact pairs."""
        model, old = self._model, self._model.model
        assert self._surface is not None
        turn = multiply(self._level, quaternion(model.data.geom_xmat[self._surface]))
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
        option, (constant, ratio) = self._model.model.opt, pair["solref"]
        is_safe = not option.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE
        return np.array([max(constant, 2.0 * option.timestep) if constant > 0.0 and is_safe else constant, ratio])

    @cached_property
    def _level(self) -> Array:
        """The rotation from the file's world to one in which the surface is level, or gravity vertical, and y is up."""
        model, old = self._model, self._model.model
        g = np.array(old.opt.gravity)
        up = -g / np.linalg.norm(g) if g.any() else np.array([0.0, 0.0, 1.0])
        if self._surface is not None:
            axes = model.data.geom_xmat[self._surface].reshape(3, 3).T
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
        model, old = self._model, self._model.model
        drag, head = Drag(*self._damping[:2]), self._head
        pose = multiply(self._level, np.roll(model.data.xquat[head], -1))
        touching = next(map(self._in_force, self._pairs.values()), None)
        return Facts(
            name=name,
            engine=f"MuJoCo {mujoco.__version__}",
            dt=old.opt.timestep,
            gravity=float(np.linalg.norm(old.opt.gravity)),
            mass=float(old.body_mass[self._group].sum()),
            inertia=inertia,
            offset=self._offset,
            parts=[self._part(geom) for geom in range(self._alone.ngeom)],
            pose=pose,
            resistance=joint_damping(*self._damping),
            falls=drag,
            spins=(drag, drag, drag),
            armature=self._armature,
            lifted=float(old.body_gravcomp[head]),
            unknown=self._unknown_forces(),
            surface="" if touching is None else next(key for key, geom in model.names(GEOM, old.ngeom).items() if geom == self._surface),
            friction=0.0 if touching is None or touching["condim"] == 1 else float(touching["friction"][0]),
            restitution=None,
            margin=0.0 if touching is None else float(touching["margin"] - touching["gap"]),
            rolling=touching is not None and touching["condim"] == 6 and bool(np.any(touching["friction"][3:])),
            rest_depth=self._rest_depth(touching, pose),
            written=self._written(),
            settings=self._settings(),
            ignored=list(self._ignored(inertia)),
            unmodelled=[words for field, words in UNMODELLED.items() if getattr(old, field, 0)],
        )

    def _part(self, number: int) -> Part:
        """A geometry as a shape, relative to the centre of mass."""
        model, data = self._alone, self._at_rest
        size, kind = model.geom_size[number], model.geom_type[number]
        position, turn = data.geom_xpos[number] - self._offset, quaternion(data.geom_xmat[number])
        solid: dict[str, Any] = {"mass": 1.0, "inertia": "solid"}
        shape: Shape
        if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            shape = Sphere(shape="sphere", radius=float(size[0]), **solid)
        elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            shape = Capsule(shape="capsule", radius=float(size[0]), half_length=float(size[1]), **solid)
        elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            shape = Cylinder(shape="cylinder", radius=float(size[0]), half_length=float(size[1]), **solid)
        elif kind == BOX:
            shape = Box(shape="box", half_extents=tuple(size.tolist()), **solid)
        elif kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            shape = Ellipsoid(shape="ellipsoid", half_extents=tuple(size.tolist()), **solid)
        else:
            shape = mesh_shape(*mesh_of(model, number))
            position = position + rotate(turn, shape.centre)
        if isinstance(shape, Capsule | Cylinder):  # along y here, along z there
            turn = multiply(turn, np.roll(UPWARD, -1))
        return Part(self._name_of(number), shape, position, turn)

    def _name_of(self, number: int) -> str:
        geom = int(self._alone.geom(number).name.split()[1])
        return next(name for name, one in self._model.names(GEOM, self._model.model.ngeom).items() if one == geom)

    def _unknown_forces(self) -> Setting | None:
        """The setting of a fluid or of dry friction in the joint, if there is one."""
        old, settings = self._model.model, self._settings()
        if self._dof is not None and old.dof_frictionloss[self._dof] > 0.0:
            return settings.get("frictionloss", Setting("frictionloss"))
        fluid = [name for name in ("density", "viscosity") if getattr(old.opt, name) > 0.0]
        return option_setting(self._model.source, "option", fluid[0], "0") if fluid else None

    def _rest_depth(self, touching: Mapping[str, Any] | None, pose: Array) -> float:
        """The depth of a body that rests on one point, or on several that share its weight, below the surface [m]; NaN of others."""
        points = 0 if touching is None else self._points(pose)
        if not points or touching is None:
            return np.nan
        option = self._alone.opt
        friction = tuple(touching["friction"][[0, 2, 3]].tolist())
        names = ("solref", "solimp", "condim", "margin")
        settings = GeomSettings(friction=friction, **{name: _plain(np.asarray(touching[name])) for name in names})
        is_safe = not option.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE
        contact = SoftContact(settings, option.cone == CONES["elliptic"], option.impratio, option.timestep if is_safe else 0.0)
        mass = float(self._alone.body_mass.sum())
        return (
            contact.depth(float(np.linalg.norm(self._model.model.opt.gravity)) * mass / (mass + self._armature) / points) - settings.margin
        )

    def _points(self, pose: Array) -> int:
        """The number of contacts in a pose that share the weight evenly; 0 if they do not, or have different settings."""
        if len(self._pairs) != 1 or (self._armature and self._offset.any()):
            return 0
        model = self._built(self._model.model.opt.timestep, np.zeros(3), True)
        data, size = mujoco.MjData(model), float(model.stat.extent)
        parts = [self._part(number) for number in range(self._alone.ngeom)]
        data.qpos[:] = [*(-rotate(pose, self._offset)), *np.roll(pose, 1)]
        data.qpos[1] -= lowest(parts, np.concatenate([np.zeros(3), pose, np.zeros(6)])[np.newaxis])[0] + FLAT * size
        mujoco.mj_forward(model, data)
        places = data.contact.pos[:, [0, 2]]
        is_even = len(places) > 0 and bool(np.abs(places.mean(axis=0)).max() < 1e-6 * size)
        return len(places) if is_even and np.ptp(np.linalg.norm(places, axis=1)) < 1e-6 * size else 0

    @cached_property
    def _element(self) -> Element | None:
        """The body in the file: by its name, or by its place if the file has as many bodies as the model."""
        bodies = list(self._model.source.every("link" if self._model.is_urdf else "body"))
        name = mujoco.mj_id2name(self._model.model, BODY, self._head)
        named = [element for element in bodies if name and element.attributes.get("name") == name]
        if not named and len(bodies) == self._model.model.nbody - 1:
            named = bodies[self._head - 1 : self._head]
        return named[0] if named else None

    def _written(self) -> Array | None:
        """The inertia that the file has for a body to which nothing is welded, about its own axes."""
        inertial = None if self._element is None else next(self._element.every("inertial"), None)
        if inertial is None or len(self._group) > 1:
            return None
        values = inertial.attributes
        if self._model.is_urdf:
            values = next(inertial.every("inertia"), inertial).attributes
            xx, yy, zz, xy, xz, yz = (float(values.get(name, 0.0)) for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
        elif "diaginertia" in values:
            (xx, yy, zz), xy, xz, yz = map(float, values["diaginertia"].split()), 0.0, 0.0, 0.0
        elif "fullinertia" in values:
            xx, yy, zz, xy, xz, yz = map(float, values["fullinertia"].split())
        else:
            return None
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def _settings(self) -> dict[str, Setting]:
        """The settings that matter, in the words of the file."""
        root, body = self._model.source, self._element
        options = {"timestep": "0.002", "integrator": "Euler", "cone": "pyramidal", "impratio": "1"}
        found = {name: option_setting(root, "option", name, default) for name, default in options.items()}
        if body is None:
            return found
        joint = next((child for child in body.children if child.tag in ("joint", "freejoint")), None)
        own = [child for child in body.children if child.tag == "geom"]
        name = "" if self._surface is None else mujoco.mj_id2name(self._model.model, GEOM, self._surface)
        there = [geom for geom in root.every("geom") if geom.attributes.get("name") == name and geom not in own] if name else []
        there = there or [geom for geom in root.every("geom") if geom not in own]
        places = {"gravcomp": [body], "damping": [joint], "armature": [joint], "frictionloss": [joint]}
        places |= {name: [*own, *there[:1]] for name in ("margin", "solref", "solimp", "friction", "condim")}
        inertial = next(body.every("inertial"), None)
        written = {name: [mjcf_setting(one, name) for one in elements if one is not None] for name, elements in places.items()}
        if inertial is not None:
            inertial = next(inertial.every("inertia"), inertial)  # of URDF
            written["inertia"] = [inertial.setting(name) for name in ("ixx", "diaginertia", "fullinertia", "mass")]
        for name, settings in written.items():
            first = next((setting for setting in settings if setting is not None), None)
            found |= {} if first is None else {name: first}
        return found

    def _ignored(self, inertia: Array) -> Iterator[tuple[str, Setting, str]]:
        """What the file says and MuJoCo changes or does not use."""
        settings, written, root = self._settings(), self._written(), self._model.source
        if any(not np.array_equal(self._clamped(pair), pair["solref"]) for pair in self._pairs.values()):
            constant = 2.0 * self._model.model.opt.timestep
            yield "solref", settings.get("solref", Setting("solref")), f"its time constant is raised to {constant:g} s, two time steps"
        if written is not None:
            wanted, has = np.linalg.eigvalsh(written), np.linalg.eigvalsh(inertia)
            if np.abs(wanted - has).max() > SAME * np.abs(wanted).max():
                why = [str(s) for name in CHANGED_BY if (s := option_setting(root, "compiler", name, "")).file]
                made = f"refused ({self._model.refusal}); measured with balanceinertia" if self._model.refusal else "changed"
                yield "inertia", settings["inertia"], f"{made}: moments {digits(has.tolist())} kg m²" + (f", by {why[0]}" if why else "")
        if self._model.is_urdf:
            element = self._element
            if self._dof is None and self._model.model.body_parentid[self._head] == 0:
                yield "base", element_words(element), "welded to the world"
            for tag in ("restitution", "rolling_friction", "spinning_friction"):
                for found in [] if element is None else element.every(tag):
                    yield tag, element_words(found), "not read"


def set_options(option: Any, compiled: Any, dt: float, changes: Changes) -> None:
    """Give a specification the options of a compiled model, but for the time step [s] and changes; without the automatic reset."""
    for name in OPTIONS:
        setattr(option, name, getattr(compiled, name))
    option.timestep = dt
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    option.integrator = INTEGRATORS[str(changes["integrator"])] if "integrator" in changes else compiled.integrator
    option.cone = CONES[str(changes["cone"])] if "cone" in changes else compiled.cone
    option.impratio = changes.get("impratio", compiled.impratio)


def element_words(element: Element | None) -> Setting:
    """An element as a setting."""
    if element is None:
        return Setting("the root link")
    value = "".join(f' {name}="{text}"' for name, text in element.attributes.items())
    return Setting(f"<{element.tag}{value}>", element.file, element.line)


def one_line(error: Exception) -> str:
    """The message of an error of MuJoCo, in one line."""
    return " ".join(str(error).removeprefix("Error:").split()).rstrip(".")


def digits(values: Sequence[float]) -> str:
    """Numbers with three digits."""
    return ", ".join(f"{value:.3g}" for value in values)


def mesh_of(model: Any, geom: int) -> tuple[Array, Any]:
    """The vertices and the triangles of a mesh in the frame of its geometry."""
    mesh = model.geom_dataid[geom]
    first, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float)
    return points, model.mesh_face[face : face + model.mesh_facenum[mesh]].astype(np.int64)


def quaternion(matrix: Array) -> Array:
    """The rotation of a matrix, shape (9,)."""
    found = np.empty(4)
    mujoco.mju_mat2Quat(found, matrix)
    return np.roll(found, -1)

"""A free body of a file that MuJoCo compiles, simulated alone, with the values that the compiled model has."""

import math
import operator
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout

from dropspin.comparisons.diagnosis.geometries import Part, at_point, lowest_of
from dropspin.comparisons.diagnosis.loose_body import LIGHT, Changes, Drag, LooseBody
from dropspin.comparisons.diagnosis.mujoco_alone import MuJoCoAlone
from dropspin.comparisons.diagnosis.mujoco_changes import ignored
from dropspin.comparisons.diagnosis.mujoco_compiled import lowers_margin, mass_properties, sleeps
from dropspin.comparisons.diagnosis.mujoco_contacts import friction_of, overrides, with_friction
from dropspin.comparisons.diagnosis.mujoco_file import ADDED, PLANE, MuJoCoFile
from dropspin.comparisons.diagnosis.mujoco_options import ELLIPTIC, ENUMERATIONS, FLAGS, OF_ALL, is_set
from dropspin.comparisons.diagnosis.mujoco_shapes import quaternion, shape_of
from dropspin.comparisons.diagnosis.mujoco_text import BodyText
from dropspin.comparisons.engines.base import Diverged
from dropspin.comparisons.engines.mujoco_model import contact
from dropspin.comparisons.engines.mujoco_settings import CONTACT, OPTION
from dropspin.comparisons.engines.mujoco_simulation import from_world, full_state, quiet, to_world
from dropspin.comparisons.engines.settings import spelled
from dropspin.scenarios.rotations import multiply, rotate
from dropspin.scenarios.state import Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths.damped_joint import joint_damping

FLAT = 1e-9
"""Depth, relative to the size, at which contacts are counted."""
SPRING_STEPS = 20.0
"""Time steps of an impact on a spring that gives a coefficient of restitution."""
LEAST_OF_A_SPRING = 0.01
SAME_HEIGHT = 1e-6
"""Difference of heights, relative to the size, up to which geometries touch a surface together."""
DEEP = 0.01
"""Depth, relative to the size, from which a body that starts inside a surface is said to."""
LEVEL = 0.1
"""Angle between gravity and the normal of a surface up to which the surface is level [°]."""
DEFAULT_CONTACT: Changes = {name: spelled(CONTACT[name].default) for name in ("solref", "solimp")}
NO_FLUID: Changes = {"density": 0.0, "viscosity": 0.0}

HIGH_IMPRATIO = 10.0
"""The ratio of frictional to normal impedance that is tried as a remedy."""
ENDS: Mapping[str, Callable[[Any, Any], bool]] = {"iterations": operator.lt, "ls_iterations": operator.lt, "tolerance": operator.gt}
"""Where MuJoCo's solver ends, and how a value compares with the default if the solver may end too early."""
REMEDIES: Mapping[str, Changes] = {
    "damping": {"damping": 0.0, "armature": 0.0, "frictionloss": 0.0},  # a <freejoint/> has none of these
    "armature": {"armature": 0.0},
    "gravcomp": {"gravcomp": 0.0},
    "integrator": {"integrator": "RK4"},
    **{name: {name: default} for name, (_, _, default) in FLAGS.items()},
    "cone": {"cone": "elliptic"},
    "impratio": {"cone": "elliptic", "impratio": HIGH_IMPRATIO},
    "margin": {"margin": 0.0},
    "frictionloss": {"frictionloss": 0.0},
    "condim": {"condim": 4},  # without rolling friction
    "density": NO_FLUID,
    "viscosity": NO_FLUID,
    "wind": {"wind": (0.0, 0.0, 0.0)},
    "sleep_tolerance": {"sleep_tolerance": 0.0},
    "solref": DEFAULT_CONTACT,
    "solimp": DEFAULT_CONTACT,
}

ROUGH = 2.0
"""Coefficient of friction from which pyramidal cones soften contacts: a box at rest is six times as deep as with 1, with 5 150 times."""
CAUSES: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("fall", "spin", "tumble"), ("eulerdamp", "integrator")),
    **dict.fromkeys(("impact", "rest", "roll"), ()),
    "slide": ("cone", "impratio"),
}
"""Settings that may change errors, by question."""


class MuJoCoModel(MuJoCoFile):
    """A model of which bodies can be simulated alone."""

    def body(self, name: str, on: str | None) -> LooseBody:
        """A body above what it lands on."""
        return MuJoCoBody(name, MuJoCoAlone(self, name, on))


class MuJoCoBody(LooseBody):
    """A free body, or a link that is cut loose, with what is welded to it.

    Args:
        name: The body's name.
        alone: Its model.
    """

    def __init__(self, name: str, alone: MuJoCoAlone) -> None:
        file, self._alone, self._file = alone.file, alone, alone.file
        self.name, self.engine, self.version = name, "MuJoCo", mujoco.__version__
        self.dt, self.gravity = file.model.opt.timestep, float(np.linalg.norm(file.gravity))
        self._model = alone.model(self.dt, np.zeros(3), floor=False)
        found = mass_properties(self._model, self._at_rest, range(1, self._model.nbody))
        assert found is not None  # bodies without mass are left out
        self.mass, self.offset, self.inertia = found
        self.pose = multiply(alone.level, np.roll(file.data.xquat[alone.head], -1))
        self.parts = list(self._parts())
        bare = np.setdiff1d(np.arange(self._model.nbody), self._model.geom_bodyid)
        self.is_bounded = bool(self._model.body_mass[bare].sum() <= LIGHT * self.mass)
        self.falls, self.resistance, self.armature = Drag(*alone.damping), joint_damping(*alone.damping), alone.armature
        self.spins = [self.falls] * 3
        # The share of the weight that `gravcomp` of the body and of what is welded to it takes away.
        self.lifted = float(np.average(self._model.body_gravcomp[1:], weights=self._model.body_mass[1:]))
        option = self._model.opt
        unmodelled = {"frictionloss": self._model.dof_frictionloss.any(), "density": option.density, "viscosity": option.viscosity}
        unmodelled["wind"] = option.wind.any() and (option.density or option.viscosity)
        self.unknown = [name for name, acts in unmodelled.items() if acts]
        self._touching = {geom: alone.in_force_of(geom) for geom in self._lowest}
        self._text = BodyText(alone, self._touching)
        self.written, self.in_own_frame, self.settings = self._text.written, self._text.in_own_frame, self._text.settings
        self._land()
        contact, sleep = self.in_file(*DEFAULT_CONTACT), ("sleep_tolerance",) * sleeps(option)
        softens = ("cone",) * (option.cone != ELLIPTIC and self.friction >= ROUGH)
        ends = [name for name, is_early in ENDS.items() if is_early(getattr(option, name), OPTION[name].default)]
        ends_or_flags = [*ends, *(name for name in ("refsafe", "diagexact") if is_set(option, name))]
        moved = (*ends_or_flags, *contact, *("margin",) * (self.margin > 0.0))
        of_contact = {"slide": moved, "roll": moved, **dict.fromkeys(("impact", "rest"), (*ends_or_flags, *softens))}
        self.remedies = {**REMEDIES, **{name: {end: OPTION[end].default for end in ends} for name in ends}}
        is_explicit = alone.damping.any() and is_set(option, "eulerdamp") and not option.integrator
        acting = {"cone": option.cone != ELLIPTIC, "eulerdamp": is_explicit, "impratio": option.impratio < HIGH_IMPRATIO}
        idle = {name for name, acts in acting.items() if not acts}
        if "cone" in idle:
            self.remedies = self.remedies | {"impratio": {"impratio": REMEDIES["impratio"]["impratio"]}}
        of_option = {question: tuple(name for name in names if name not in idle) for question, names in CAUSES.items()}
        self.causes = {question: (*sleep, *acting, *of_contact.get(question, ())) for question, acting in of_option.items()}

    def changed(self, changes: Changes) -> LooseBody:
        return MuJoCoBody(self.name, self._alone.changed(changes))

    def patch(self, changes: Changes, dt: float) -> str:
        texts = {self._named(name): spelled(value) for name, value in changes.items()}
        options = {name: text for name, text in texts.items() if name in OF_ALL}
        options |= {"timestep": f"{dt:g}"} if dt != self.dt else {}
        others = {name: text for name, text in texts.items() if name not in options}
        if "o_friction" in options:  # which all contacts have, those without friction too
            found = [with_friction(contact, options["o_friction"]) for contact in self._touching.values()]
            options["o_friction"] = " ".join(f"{value:g}" for value in found[0]["friction"])
            others |= {"condim": "3"} if any("condim" in one for one in found) else {}
        return self._text.patch(options, others)

    def _named(self, name: str) -> str:
        """The name of what has to be changed for a setting: an option, if it overrides the settings of all contacts."""
        return f"o_{name}" if name in overrides(self._file.model) else name

    def for_contact(self, restitution: float | None, friction: float | None, dt: float) -> Changes:
        changes = {} if restitution is None else self._for_restitution(restitution, dt)
        return changes if friction is None else {**changes, "friction": friction}

    def _for_restitution(self, restitution: float, dt: float) -> Changes:
        is_rk4 = self._model.opt.integrator == ENUMERATIONS["RK4"]  # all stages of which a damper for one step acts in
        floor = Floor(restitution=max(restitution, LEAST_OF_A_SPRING) if is_rk4 else restitution, friction=0.0)
        settings = contact(floor, dt, spring_steps=SPRING_STEPS if is_rk4 else 0.0)
        names = ("solref", "solimp", "solreffriction") if self._text.can_pair else ("solref", "solimp")
        return {name: " ".join(f"{value:.6g}" for value in settings[name]) for name in names}

    @property
    def likeness(self) -> tuple[object, ...]:
        model = self._alone.model(self.dt, np.zeros(3), floor=bool(self.surface))
        stored = np.empty(mujoco.mj_sizeModel(model), np.uint8)
        mujoco.mj_saveModel(model, None, stored)
        element = self._text.element
        words = [] if element is None else [one.words for one in (*element.children, element)]
        return stored.tobytes(), self.pose.tobytes(), self.surface, *self.unmodelled, *words

    def elsewhere(self, dt: float, changes: Changes) -> tuple[int, bool]:
        is_global = dt != self.dt or not OF_ALL.isdisjoint(map(self._named, changes))
        others = [body for body in self._file.heads.values() if body != self._alone.head] if is_global else []
        return len(others), not is_global or self._file.runs(dt, changes)

    def motions(self, starts: Array, dt: float, steps: int, gravity: Array, *, floor: bool) -> Array:
        model = self._alone.model(dt, gravity, floor=floor)
        data = mujoco.MjData(model)
        first = np.tile(full_state(model, data), (len(starts), 1))
        first[:, 1:14] = from_world(at_point(starts, -self.offset))
        rows = np.empty((len(starts), 1 + steps, first.shape[1]))
        rows[:, 0] = first
        if steps:
            with quiet():
                rows[:, 1:], _ = rollout.rollout(model, data, first, nstep=steps)
        if any(warning.number for warning in data.warning[-3:]) or not np.isfinite(rows).all():
            raise Diverged(f"MuJoCo's state became NaN or too large within {steps} steps of {dt:g} s")
        return at_point(to_world(rows[..., 1:14]), self.offset)

    @cached_property
    def _at_rest(self) -> Any:
        data = mujoco.MjData(self._model)
        data.qpos[:] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        mujoco.mj_kinematics(self._model, data)
        return data

    def _land(self) -> None:
        """Set what is in force between the body and what it lands on."""
        alone, file = self._alone, self._file
        off = alone.gravity_angle
        is_above = off < 90.0 - LEVEL  # also without gravity
        touching = next(iter(self._touching.values()), None) if is_above else None
        surface = None if touching is None else alone.surface
        self.surface, self.others = "" if surface is None else alone.names[surface], [alone.names[geom] for geom in alone.others]
        self.missed, self.left_out = alone.missed if is_above and file.gravity.any() else "", alone.left_out
        every = {friction_of(one) for one in self._touching.values()}
        frictions = (0.0, 0.0) if touching is None else next(iter(every)) if len(every) == 1 else (math.nan, math.nan)
        self.friction, self.friction_across = frictions[0], math.nan if frictions[0] == frictions[1] else frictions[1]
        self.margin, condim = (0.0, 0) if touching is None else (_margin(touching), int(touching["condim"]))
        resists = touching is not None and condim == 6 and bool(np.any(touching["friction"][3:]))
        self.rolling = (self.in_file("condim", "friction") or ("condim",)) if resists else ()
        self.rest_depth = self._rest_depth()
        raised = any(not np.array_equal(alone.clamped(pair), pair["solref"]) for pair in alone.pairs.values())
        self.ignored = list(ignored(self._text, self, raised=raised, condim=condim))
        inside = 0.0 if surface is None or alone.names[surface] == ADDED else self._start_inside()
        is_beside = surface is not None and file.model.geom_type[surface] != PLANE and math.isinf(file.height_above(surface, alone.geoms))
        start = ["a start beside or below the surface"] * is_beside
        start += [f"a start {inside:.3g} m inside the surface"] * bool(inside > DEEP * self._model.stat.extent)
        tilted = [f"a gravity {off:.3g}° from the inward normal of the surface"] * (off > LEVEL)
        names = ", ".join(alone.names[geom] for geom in self._touching)
        several = [f"a slide on geometries of different friction ({names})"] * (len(every) > 1)
        self.unmodelled = [*file.unmodelled(alone.head), *start, *tilted, *several, *filter(None, (alone.left_out, alone.between))]

    def _parts(self) -> Iterator[Part]:
        """The geometries as shapes, relative to the centre of mass."""
        data, pairs = self._at_rest, self._alone.pairs
        for number, geom in enumerate(self._alone.geoms):
            shape, turned = shape_of(self._model, number)
            turn = quaternion(data.geom_xmat[number])
            position = data.geom_xpos[number] - self.offset + rotate(turn, shape.centre)
            yield Part(self._alone.names[geom], shape, position, multiply(turn, turned), not pairs or geom in pairs)

    @property
    def _lowest(self) -> list[int]:
        """The geometries that touch a level surface first in the pose of the file."""
        heights = {}
        for geom, part in zip(self._alone.geoms, self.parts, strict=True):
            if geom in self._alone.pairs:
                heights[geom] = lowest_of([part], self.pose) - _margin(self._alone.in_force_of(geom))
        tolerance = SAME_HEIGHT * self._model.stat.extent
        return [geom for geom, height in heights.items() if height <= min(heights.values()) + tolerance]

    def _rest_depth(self) -> float:
        """The depth of a body that rests on one point, or on several that share its weight, below the surface [m]; NaN of others."""
        contact, armature = self._alone.contact, self._alone.armature
        is_central = not (armature and self.offset.any()) and self.lifted < 1.0 and not np.ptp(self._model.body_gravcomp[1:])
        is_still = not self._model.opt.wind.any()  # the air moves no body at rest
        points = self._points() if contact is not None and is_central and is_still else 0
        is_regular = points == 1 or not is_set(self._model.opt, "diagexact")  # else the others change how hard each point is
        if not points or contact is None or not is_regular:
            return np.nan
        load = self.gravity * (1.0 - self.lifted) * self.mass / (self.mass + armature) / points
        return contact.depth(load) - contact.settings.margin

    def _start_inside(self) -> float:
        """How far below a plane the body's lowest point is in the file [m]; 0 if it lands on a box, which it may be beside."""
        alone, file = self._alone, self._file
        parts = [part for part in self.parts if part.collides]
        if file.model.geom_type[alone.surface] != PLANE or not parts:
            return 0.0
        above = rotate(alone.level, file.data.xpos[alone.head] - file.data.geom_xpos[alone.surface])
        centre = above + rotate(self.pose, self.offset)
        return -float(centre[1] + lowest_of(parts, self.pose))

    def _points(self) -> int:
        """The number of contacts in the pose of the file that share the weight evenly; 0 if they do not."""
        model = self._alone.model(self._file.model.opt.timestep, np.zeros(3), floor=True)
        data, size = mujoco.MjData(model), float(model.stat.extent)
        parts = [part for part in self.parts if part.collides]
        data.qpos[:] = [*(-rotate(self.pose, self.offset)), *np.roll(self.pose, 1)]
        data.qpos[1] -= lowest_of(parts, self.pose) + FLAT * size
        with quiet():
            mujoco.mj_forward(model, data)
        places = data.contact.pos[:, [0, 2]]
        is_even = len(places) > 0 and bool(np.abs(places.mean(axis=0)).max() < 1e-6 * size)
        return len(places) if is_even and np.ptp(np.linalg.norm(places, axis=1)) < 1e-6 * size else 0


def _margin(contact: Mapping[str, Any]) -> float:
    """The height above the surface from which a contact acts [m]."""
    return float(contact["margin"] - lowers_margin() * contact["gap"])

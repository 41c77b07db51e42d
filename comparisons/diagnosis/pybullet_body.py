"""Bodies of URDF files that PyBullet loads with its defaults, with the values that it has in force.

A body is simulated above plane.urdf of pybullet_data, turned so that y is up. Its frame is that of its first link, as the file has it, not
the inertial frame whose pose PyBullet reports.
"""

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pybullet_data  # type: ignore[import-untyped]

from dropspin.comparisons.diagnosis.geometries import Part, at_point, lowest_of
from dropspin.comparisons.diagnosis.inertia import inertia
from dropspin.comparisons.diagnosis.loose_body import LIGHT, Changes, Drag, LooseBody, MassProperties
from dropspin.comparisons.diagnosis.pybullet_links import MARGIN, Link, read_links
from dropspin.comparisons.diagnosis.pybullet_server import load, server
from dropspin.comparisons.diagnosis.urdf_file import UrdfFile, package_remedy
from dropspin.comparisons.diagnosis.xml_file import Ignored, Setting
from dropspin.comparisons.engines.base import Diverged
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.pybullet_simulation import CHUNK, Z_TO_Y
from dropspin.scenarios import DropspinError
from dropspin.scenarios.errors import UnknownName
from dropspin.scenarios.rotations import conjugate, multiply, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array
from dropspin.scenarios.truths.damped_joint import Resistance, bullet_damping

STEP, GRAVITY, DAMPING = 1.0 / 240.0, 9.81, 0.04
"""Bullet's time step [s], the acceleration of gravity that is set, and Bullet's damping of a multibody, by velocity and by spin."""
SURFACE = "plane.urdf"
PLANE = os.path.join(os.path.dirname(pybullet_data.__file__), SURFACE)
FAR = [0.0, 1e3, 0.0]
SLOP = 1e-5  # m; the depth that Bullet's contacts leave
DEFAULTS = {
    "timestep": f"fixedTimeStep=1/{round(1.0 / STEP)}",
    "damping": f"linearDamping=angularDamping={DAMPING:g}",
    "contactERP": "contactERP=0.08",
    "margin": f"a margin of {MARGIN:g} m around convex hulls",
    "friction": "lateralFriction=0.5",
}
CALLS = {
    "damping": "changeDynamics(body, -1, linearDamping=0, angularDamping=0)",
    "inertia": "loadURDF(..., flags=URDF_USE_INERTIA_FROM_FILE)",
    "contactERP": "setPhysicsEngineParameter(contactERP={:g})",
    "stiffness": "the file without <stiffness> and <damping>",
    "restitution": "changeDynamics(plane, -1, restitution={:g})",
    "own restitution": "changeDynamics(body, -1, restitution={:g})",
    "rolling": "changeDynamics(body, -1, rollingFriction={:g})",
    "friction": "changeDynamics(body, -1, lateralFriction={:g})",
}
"""What to call for changes of settings."""
OF_LINKS = {"own restitution": "restitution", "rolling": "rollingFriction", "friction": "lateralFriction"}
"""What PyBullet calls settings of each link."""
OF_EVERY_LINK = "for link in range(-1, getNumJoints(body)): changeDynamics(body, link, {}={{:g}})"
WRITTEN = (
    ("lateral_friction", "value", "friction"),
    ("restitution", "value", "restitution"),
    ("inertia", "ixx", "inertia"),
    ("mass", "value", "mass"),
    ("collision", "group", "group"),
    ("collision", "mask", "mask"),
    ("stiffness", "value", "stiffness"),
)
"""Elements and attributes of URDF, and the names of their settings."""


class PyBulletModel(UrdfFile):
    """A URDF file as PyBullet loads it; arguments and errors are those of a URDF file."""

    def __init__(self, path: Path, given: str) -> None:
        super().__init__(path, given)
        server().clear()
        load(given, str(path), remedy=package_remedy(self.source))

    def body(self, name: str, on: str | None) -> LooseBody:
        """One of the bodies, above what it lands on."""
        if on not in (None, SURFACE):
            raise UnknownName("PyBullet's surface", str(on), [SURFACE])
        return PyBulletBody(self, name, {})


class PyBulletBody(LooseBody):
    """A link, with what is fixed to it.

    Args:
        model: The file.
        name: The link's name.
        changes: Settings that differ from PyBullet's, those of `CALLS`; `restitution` is that of the surface.

    Raises:
        DropspinError: PyBullet gives the body no mass or no inertia.
    """

    def __init__(self, model: PyBulletModel, name: str, changes: Changes) -> None:
        self._model, self._changes = model, changes
        self.name, self.engine, self.version = name, "PyBullet", version("pybullet")
        self.dt, self.gravity = STEP, GRAVITY
        without = ("stiffness", "damping") if "stiffness" in changes else ()
        self._file = model.cut_loose(name, *without) if without or len(model.heads) > 1 else str(model.path)
        body, self._plane = self._world(True)
        self._links = read_links(model, body)
        first = self._links[0]
        if first.mass == 0.0:
            raise DropspinError(f"{model.given}: link {name} has no mass, so that PyBullet holds it still.")
        self._masses = np.array([link.mass for link in self._links])
        own = np.sum([link.inertia for link in self._links], axis=0)
        if not (np.isfinite([*self._masses, *own.flat]).all() and self._masses.sum() > 0.0 and np.linalg.det(own) > 0.0):
            moments = ", ".join(f"{moment:g}" for moment in first.dynamics[2])
            raise DropspinError(f"{model.given}: PyBullet gives link {name} the mass {first.mass:g} kg and the moments {moments} kg m².")
        centres = np.array([link.position for link in self._links])
        centre = np.average(centres, axis=0, weights=self._masses)
        self._arms, self._arm = centres - centre, unrotate(first.turn, centre - first.position)
        self._find_in_force(centre, own)
        of_spring = dict.fromkeys(("slide", "roll"), ("stiffness",))
        self.causes = of_spring if "stiffness" in self.settings else {"impact": ("contactERP",)}
        self.remedies = {"damping": {"damping": 0.0}, "inertia": {"inertia": "file"}, "contactERP": {"contactERP": 0.0}}
        self.remedies |= {"stiffness": {"stiffness": "none"}, "rolling": {"damping": 0.0, "rolling": 0.0}}
        if any(link.restitution > 0.0 for link in self._touching):
            self.remedies["restitution"] = {"restitution": 1.0}

    def changed(self, changes: Changes) -> LooseBody:
        return PyBulletBody(self._model, self.name, {**self._changes, **changes})

    def patch(self, changes: Changes, dt: float) -> str:
        texts = CALLS if len(self._links) == 1 else CALLS | {name: OF_EVERY_LINK.format(key) for name, key in OF_LINKS.items()}
        calls = [texts[name].format(value) for name, value in changes.items()]
        return ", ".join([*calls, *([f"setTimeStep({dt:g})"] if dt != STEP else [])])

    def for_contact(self, restitution: float | None, friction: float | None, dt: float) -> Changes:
        changes = {} if restitution is None else {"own restitution": restitution, "restitution": 1.0, "contactERP": 0.0}
        return changes if friction is None else {**changes, "friction": friction / self._friction_of_plane}

    def motions(self, starts: Array, dt: float, steps: int, gravity: Array, *, floor: bool) -> Array:
        body, _ = self._world(floor)
        bullet, inertial = server(), self._links[0].turn
        bullet.setTimeStep(dt)
        bullet.setGravity(*map(float, gravity))
        rows = np.empty((len(starts), 1 + steps, 13))
        rows[:, 0] = starts
        rows[:, 0, ORIENTATION] = multiply(starts[:, ORIENTATION], inertial)
        rows[:, 0] = at_point(rows[:, 0], -self._arm)
        for row in rows:
            start = row[0].tolist()
            bullet.resetBasePositionAndOrientation(body, FAR, start[ORIENTATION])
            bullet.performCollisionDetection()  # which forgets the contacts of the last motion
            bullet.resetBasePositionAndOrientation(body, start[POSITION], start[ORIENTATION])
            bullet.resetBaseVelocity(body, start[VELOCITY], start[SPIN])
            for first in range(1, 1 + steps, CHUNK):
                row[first : first + CHUNK] = bullet.states_after_each(body, 1, min(CHUNK, 1 + steps - first))
        if not np.isfinite(rows).all():
            raise Diverged(f"PyBullet's state became NaN within {steps} steps of {dt:g} s")
        rows = at_point(rows, self._arm)
        rows[..., ORIENTATION] = multiply(rows[..., ORIENTATION], conjugate(inertial))
        return rows

    def _world(self, floor: bool) -> tuple[int, int]:
        """The numbers of the body and of the surface in a world with nothing else; it stays until another one is needed."""
        bullet, changes = server(), self._changes
        if bullet.holds != (self, floor):
            bullet.clear()
            if "contactERP" in changes:
                bullet.setPhysicsEngineParameter(contactERP=changes["contactERP"])
            body = load(self._model.given, self._file, bullet.URDF_USE_INERTIA_FROM_FILE if "inertia" in changes else 0)
            if "damping" in changes:
                bullet.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)
            plane = bullet.loadURDF(PLANE, baseOrientation=Z_TO_Y.tolist()) if floor else -1
            if floor and "restitution" in changes:
                bullet.changeDynamics(plane, -1, restitution=changes["restitution"])
            of_links = {key: changes[name] for name, key in OF_LINKS.items() if name in changes}
            for link in range(-1, bullet.getNumJoints(body)) if of_links else ():
                bullet.changeDynamics(body, link, **of_links)
            bullet.holds, bullet.numbers = (self, floor), (body, plane)
        return bullet.numbers

    def _find_in_force(self, centre: Array, own: Array) -> None:
        """Set what is in force; `own` is the sum of the links' tensors about their own centres of mass."""
        mass, squares = float(self._masses.sum()), np.sum(self._masses * np.sum(self._arms**2, axis=1))
        kappa = 0.0 if "damping" in self._changes else DAMPING
        self.mass, self.inertia = mass, own + squares * np.eye(3) - (self._arms.T * self._masses) @ self._arms
        self.offset, self.pose = np.zeros(3), Z_TO_Y
        self.resistance, self.falls = self._resistance(own, kappa), Drag(kappa * mass, kappa * mass)
        self.spins = [self._drag(axis, own, kappa) for axis in self.principal[1].T]
        plane = server().getDynamicsInfo(self._plane, -1)
        owned = [(link, part, _height(part)) for link in self._links for part in link.parts(self._model, centre)]
        parts, written = [part for _, part, _ in owned], self._links[0].written
        lowest = min((height for _, _, height in owned), default=0.0)
        self._touching = [link for link, _, height in owned if height <= lowest + SLOP] or self._links[:1]
        touching, bottom = self._touching, [part for _, part, height in owned if height == lowest]
        frictions, restitutions = {link.dynamics[1] for link in touching}, {(link.restitution, link.dynamics[9]) for link in touching}
        is_hard = all(link.dynamics[9] < 0.0 for link in touching)  # a spring and damper have no restitution
        is_held = any(part.collides for part in parts)
        self.parts, self.surface = parts, SURFACE if is_held else ""
        bare = [link.mass for link in self._links if not link.geometry and next(link.element.every("visual"), None) is None]
        self.is_bounded = sum(bare) <= LIGHT * mass
        self.missed = f"{SURFACE}: its collision group and mask exclude static bodies" if parts and not is_held else ""
        self._friction_of_plane = plane[1]
        self.friction = touching[0].dynamics[1] * plane[1] if len(frictions) == 1 else math.nan
        self.restitution = touching[0].restitution * plane[5] if is_hard and len(restitutions) == 1 else None
        self.margin = MARGIN if any(part.shape.shape == "mesh" for part in bottom) else 0.0
        self.rolling = ("rolling",) * any(link.dynamics[6] > 0.0 for link in touching)
        self.rest_depth = SLOP - self.margin if is_hard else math.nan
        self.written = None if written is None or len(self._links) > 1 else MassProperties(mass, np.zeros(3), written)
        self.in_own_frame = None if self.written is None else self._links[0].in_own_frame
        self.settings, self.ignored = self._settings(touching[0]), self._ignored(plane[5])
        self.unmodelled = ["joints"] if len(self._model.heads) > 1 else []
        if not parts or any(answer.findings for answer in inertia(self)):
            self.parts = [*parts, *(part for link in self._links for part in link.parts(self._model, centre, visual=True))]

    def _drag(self, axis: Array, own: Array, kappa: float) -> Drag:
        """The damping of a spin about an axis: each link is damped by its own speed, ω times its distance from the axis."""
        distances, about = np.linalg.norm(np.cross(self._arms, axis), axis=1), axis @ own @ axis
        return Drag(*(kappa * float(about + self._masses @ distances**power) for power in (2, 3)))

    def _resistance(self, own: Array, kappa: float) -> Resistance:
        """The damping; of several links, as if the body turned without moving, and moved without turning."""
        base, arms, masses = bullet_damping(self._masses.sum(), own, kappa, kappa), self._arms, self._masses

        def resistance(velocity: Array, spin: Array) -> tuple[Array, Array]:
            force, torque = base(velocity, spin)
            speeds = np.cross(spin, arms)
            weights = kappa * masses * (1.0 + np.linalg.norm(speeds, axis=1))
            return force, torque - weights @ np.cross(arms, speeds)

        return resistance

    def _settings(self, touching: Link) -> dict[str, Setting]:
        """The settings that matter, those of contacts of a link that touches, in the words of the file or as PyBullet's defaults."""
        link = self._model.links[self.name]
        owned = [(link if name in ("inertia", "mass") else touching.element, tag, at, name) for tag, at, name in WRITTEN]
        written = {name: found for owner, tag, at, name in owned for one in owner.every(tag) if (found := one.setting(at))}
        for inertial in link.every("inertial"):
            origin = next(inertial.every("origin"), inertial)
            written["centre"] = origin.words
            if (turn := origin.setting("rpy")) is not None:
                written["turn"] = turn
        for rolling in touching.element.every("rolling_friction"):
            written["rolling"] = rolling.words
        return {name: Setting(text) for name, text in DEFAULTS.items()} | written

    def _ignored(self, restitution: float) -> Sequence[Ignored]:
        """What the file says and PyBullet changes or does not use; `restitution` is that of the surface."""
        found = list(self._links[0].ignored(SURFACE, restitution))
        for link in self._links[1:]:
            name = link.element.attributes["name"]
            found += [(f"{key} of {name}", setting, made) for key, setting, made in link.ignored(SURFACE, restitution)]
        joints = [joint for joint in self._model.joints(self.name) if joint.attributes["type"] == "floating"]
        return found + [("joint", joint.words, "replaced by a fixed joint") for joint in joints]


def _height(part: Part) -> float:
    """The height of a geometry's lowest point in the file's pose, with the margin of a convex hull, above the centre of mass [m]."""
    return lowest_of([part], Z_TO_Y) - MARGIN * (part.shape.shape == "mesh")

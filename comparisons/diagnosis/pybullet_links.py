"""The links of a body as PyBullet loads them: mass, inertia and collision geometry in force, and what of the file is not in force."""

import math
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from dropspin.comparisons.diagnosis.answers import digits
from dropspin.comparisons.diagnosis.geometries import Part, mesh_shape, solid
from dropspin.comparisons.diagnosis.pybullet_server import load, server
from dropspin.comparisons.diagnosis.urdf_file import UrdfFile, used_by_neither_engine, without_collision
from dropspin.comparisons.diagnosis.xml_file import Element, Ignored, Setting
from dropspin.comparisons.engines.pybullet_simulation import Z_TO_Y
from dropspin.scenarios import DropspinError
from dropspin.scenarios.bodies import Capsule, Cylinder, Shape
from dropspin.scenarios.bodies.hull import convex_hull
from dropspin.scenarios.bodies.inertia import OF_URDF, symmetric
from dropspin.scenarios.rotations import conjugate, multiply, rotate
from dropspin.scenarios.state import Array
from dropspin.scenarios.text import printable

MARGIN = 1e-3  # m; what Bullet adds to convex hulls
STATIC = 2
"""Bullet's collision group of static bodies, whose mask excludes it."""
SAME = 0.01
"""Relative difference up to which a moment of inertia is the one that was written."""
OF_CONTACT = ("friction", "lateral_friction", "restitution", "rolling_friction", "spinning_friction")
"""Elements that PyBullet reads within <contact> alone."""


class Link(NamedTuple):
    """A link, with its centre of mass and its inertial frame in the frame of the body's first link.

    Attributes:
        element: The link in the file.
        dynamics: What PyBullet's getDynamicsInfo returns.
        geometry: What PyBullet's getCollisionShapeData returns.
        position: The centre of mass [m], shape (3,).
        turn: The rotation of the inertial frame, shape (4,).
    """

    element: Element
    dynamics: Sequence[Any]
    geometry: Sequence[Any]
    position: Array
    turn: Array

    @property
    def mass(self) -> float:
        """[kg]."""
        return float(self.dynamics[0])

    @property
    def restitution(self) -> float:
        """The coefficient of restitution, which Bullet multiplies with that of the surface."""
        return float(self.dynamics[5])

    @property
    def inertia(self) -> Array:
        """The inertia about the centre of mass [kg m²], shape (3, 3)."""
        return self._turned(np.diag(self.dynamics[2]))

    @property
    def written(self) -> Array | None:
        """The inertia that the file has [kg m²], shape (3, 3); None if it has none."""
        return None if self.in_own_frame is None else self._turned(self.in_own_frame)

    @property
    def in_own_frame(self) -> Array | None:
        """The same about the axes of its own frame."""
        element = next(self.element.every("inertia"), None)
        return None if element is None else np.array(symmetric([element.number(name, 0.0) for name in OF_URDF]))

    @property
    def collides(self) -> bool:
        """Whether its collision group or mask lets it collide with a static body, by PyBullet's defaults; the last ones written count."""
        group, mask = 1, -1
        for element in self.element.every("collision"):
            group, mask = int(element.number("group", group)), int(element.number("mask", mask))
        return bool(group & ~STATIC or mask & STATIC)

    def _turned(self, tensor: Array) -> Array:
        axes = rotate(self.turn, np.eye(3)).T
        turned: Array = axes @ tensor @ axes.T
        return turned

    def parts(self, file: UrdfFile, centre: Array, *, visual: bool = False) -> Iterator[Part]:
        """The geometries that collide, relative to the body's centre of mass, or the solid ones of those that are visual.

        Raises:
            DropspinError: One that collides is not a solid.
        """
        geometry, origin, turn = self.geometry, self.position, self.turn
        if visual:
            geometry, turn = _visual(file, self.element), multiply(self.turn, conjugate(np.array(self.dynamics[4])))
            origin = self.position - rotate(turn, np.array(self.dynamics[3]))
        elements = self.element.every("visual" if visual else "collision")
        for (_, _, kind, sizes, _, place, own), element in zip(geometry, elements, strict=True):
            shape, turns = _shape(file, kind, sizes, element), multiply(turn, np.array(own))
            if shape is not None:
                position = origin + rotate(turn, np.array(place)) - centre + rotate(turns, shape.centre)
                name = element.attributes.get("name", self.element.attributes["name"])
                along = multiply(turns, conjugate(Z_TO_Y)) if isinstance(shape, Capsule | Cylinder) else turns
                yield Part(name, shape, position, along, collides=self.collides and not visual)
            elif not visual:
                raise DropspinError(f"{file.given}: line {element.line}: a geometry that is not a solid of finite size.")

    def ignored(self, surface: str, restitution: float) -> Iterator[Ignored]:
        """What the file says of the link and PyBullet changes or does not use.

        Args:
            surface: The surface's name.
            restitution: That of the surface.
        """
        written = self.written
        if written is None:
            yield "inertial", Setting("no inertial", self.element.file, self.element.line), f"missing: the mass is {self.mass:g} kg"
        elif np.abs(written - self.inertia).max() > SAME * np.abs(written).max():
            times = " times <inertia_scaling>" if next(self.element.every("inertia_scaling"), None) else ""
            balls = [sizes[0] for _, _, kind, sizes, *_ in self.geometry if kind == server().GEOM_SPHERE]
            # Of a ball that is turned or displaced, PyBullet takes the box that bounds it.
            is_ball = len(self.geometry) == 1 and any(
                bool(times) or math.isclose(self.dynamics[2][0], 0.4 * self.mass * r**2, rel_tol=SAME) for r in balls
            )
            of = "the sphere" if is_ball else "the bounding box of the collision geometry" if self.geometry else "a box of 2 mm"
            made = f"replaced by that of {of}{times}: {digits(self.dynamics[2])} kg m²"
            yield "inertia", next(self.element.every("inertia")).words, made
        for element in self.element.every(*OF_CONTACT):
            is_read = element.parent is not None and element.parent.tag == "contact"
            if not is_read:
                yield element.tag, element.words, "not read, because it is not within <contact>"
            elif element.tag == "restitution" and self.restitution * restitution != self.restitution:
                of_surface = f"the product with the restitution {restitution:g} of {surface}"
                yield element.tag, element.words, f"{self.restitution * restitution:g}, {of_surface}"
        yield from ((element.tag, element.words, "not read") for element in used_by_neither_engine(self.element))
        for collision in self.element.every("collision"):
            for element in collision.every("cylinder"):
                yield "cylinder", element.words, f"replaced by the convex hull of 64 points, with a margin of {MARGIN:g} m"
        yield from without_collision(self.element)


def read_links(file: UrdfFile, body: int) -> list[Link]:
    """The links of a body that was just loaded, so that the frame of the first one is that of the world."""
    bullet, found = server(), []
    for number in range(-1, bullet.getNumJoints(body)):
        if number < 0:
            name, pose = bullet.getBodyInfo(body)[0], bullet.getBasePositionAndOrientation(body)
        else:
            name, pose = bullet.getJointInfo(body, number)[12], bullet.getLinkState(body, number, computeForwardKinematics=True)
        read = bullet.getDynamicsInfo(body, number), bullet.getCollisionShapeData(body, number)
        found.append(Link(file.links[printable(name.decode())], *read, np.array(pose[0]), np.array(pose[1])))
    for collision in (
        one for link in found for one in link.element.every("collision") if "concave" in one.attributes and [*one.every("mesh")]
    ):
        why = "a concave mesh, of which PyBullet has triangles without volume; leave out concave to diagnose its convex hull"
        raise DropspinError(f"{file.given}: line {collision.line}: {why}.")
    return found


@cache
def _visual(file: UrdfFile, link: Element) -> Sequence[Any]:
    """The visual geometries of a link, as PyBullet has them if they collide."""
    text = "".join(map(file.written, link.every("visual"))).replace("<visual", "<collision").replace("</visual", "</collision")
    number = load(file.given, f'<robot name="visual"><link name="visual">{text}</link></robot>')
    found: Sequence[Any] = server().getCollisionShapeData(number, -1)
    server().removeBody(number)
    return found


def _shape(file: UrdfFile, kind: int, sizes: Sequence[float], element: Element) -> Shape | None:
    """A geometry as a shape, None if it is not a solid of finite size; `sizes` are those that PyBullet has."""
    bullet = server()
    used = [abs(size) for size in sizes[: {bullet.GEOM_SPHERE: 1, bullet.GEOM_CAPSULE: 2}.get(kind, 3)]]
    if not all(0.0 < size < math.inf for size in used):
        return None
    if kind == bullet.GEOM_SPHERE:
        return solid("sphere", radius=used[0])
    if kind == bullet.GEOM_BOX:
        return solid("box", half_extents=[0.5 * size for size in used])
    if kind == bullet.GEOM_CAPSULE:
        return solid("capsule", half_length=0.5 * used[0], radius=used[1])
    return _hull(file, element) if kind == bullet.GEOM_MESH else None


@cache
def _hull(file: UrdfFile, element: Element) -> Shape | None:
    """The convex hull that PyBullet makes of a mesh or a cylinder, for which a body that has it alone is loaded; None if it is flat.

    Of an OBJ file of several objects it makes one for each; the hull of all bounds them then, but is no solid.
    """
    bullet, geometry = server(), file.written(next(element.every("geometry")))
    number = load(file.given, f'<robot name="hull"><link name="hull"><collision>{geometry}</collision></link></robot>')
    points = np.array(bullet.getMeshData(number, -1)[1])
    bullet.removeBody(number)
    hull = convex_hull(points) if len(points) > 3 else None
    if hull is None:
        return None
    faces = hull.simplices.astype(np.int64)
    outward = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    inside_out = np.sum(outward * hull.equations[:, :3], axis=1) < 0.0
    faces[inside_out] = faces[inside_out, ::-1]
    has_parts = any(file.number_of_objects(mesh) > 1 for mesh in element.every("mesh"))
    return solid("mesh", points=points, faces=faces, inertia="surface") if has_parts else mesh_shape(points, faces)

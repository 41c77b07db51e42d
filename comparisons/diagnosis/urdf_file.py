"""A URDF file: its links, what is fixed to what, and a file of one link that is cut loose."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from xml.sax.saxutils import quoteattr

from dropspin.comparisons.diagnosis.xml_file import Element, Ignored, read_source
from dropspin.scenarios import DropspinError
from dropspin.scenarios.errors import verify_known
from dropspin.scenarios.text import printable

FIXED = ("fixed", "floating")
"""Types of joints of which PyBullet makes fixed ones."""

OF_GAZEBO_AND_DRAKE = ("mu1", "mu2", "kp", "kd", "drake:mu_static", "drake:mu_dynamic")
UNUSED = (*OF_GAZEBO_AND_DRAKE, "contact_coefficients", "contact_cfm", "contact_erp", "contact_stiffness", "contact_damping")
"""Settings of contacts for Gazebo and Drake, and of older files, two that Bullet's loader reads in vain, and two that it does not."""

PACKAGES = ("package://", "model://")
"""How ROS and Gazebo begin paths in folders that they look up."""


class UrdfFile:
    """A URDF file.

    Args:
        path: The file.
        given: Its name for messages.

    Raises:
        DropspinError: It is not a URDF file, or does not have exactly one root link.
    """

    def __init__(self, path: Path, given: str) -> None:
        self.path, self.given = path, given
        self.source = read_source(path)
        self.links = {printable(link.attributes.get("name", "")): link for link in self.source.children if link.tag == "link"}
        self._parents = _parents(self.source)
        verify_one_root(self.source, given)

    @cached_property
    def heads(self) -> dict[str, list[str]]:
        """The root and the links that move against their parents, each with the links that are fixed to it."""
        found: dict[str, list[str]] = {}
        for name in self.links:
            head = name
            for _ in self.links:
                joint = self._parents.get(head)
                if joint is None or joint.attributes.get("type") not in FIXED:
                    break
                head = _end(joint, "parent")
            found.setdefault(head, []).append(name)
        return found

    def bodies(self, wanted: Sequence[str], loose: bool) -> list[str]:
        """The names of the bodies that are free, or that are asked for, or of all that move.

        Raises:
            UnknownName: There is no such body.
            DropspinError: No body is free.
        """
        verify_known("the model's body", wanted, self.heads)
        if not wanted and not loose and len(self.heads) > 1:
            joined = f"{', '.join(self.heads)} are joined"
            raise DropspinError(f"{self.given}: no body is free: {joined}; name one with --body, or give --loose for all.")
        found = list(wanted) or [name for name in self.heads if _is_heavy(self.links[name])]
        if not found:
            raise DropspinError(f"{self.given}: no link that moves has mass, so that PyBullet holds them still.")
        return found

    def others(self, chosen: Sequence[str]) -> str:
        """The bodies with mass beside those that are free: none, because all links of a file are joined."""
        return ""

    def joints(self, head: str) -> list[Element]:
        """The joints between a body and the links that are fixed to it."""
        return [self._parents[name] for name in self.heads[head] if name != head]

    def cut_loose(self, head: str, *without: str) -> str:
        """A URDF file of a body and of what is fixed to it, with the meshes' absolute paths, and without some elements."""
        elements = [*(self.links[name] for name in self.heads[head]), *self.joints(head)]
        return f'<robot name="loose">{"".join(self.written(element, *without) for element in elements)}</robot>'

    def written(self, element: Element, *without: str) -> str:
        """An element as XML, without some elements and without materials, which may refer to others."""
        values = {key: self._mesh(text) if key == "filename" else text for key, text in element.attributes.items()}
        within = "".join(self.written(child, *without) for child in element.children if child.tag not in ("material", *without))
        return f"<{element.tag} {' '.join(f'{key}={quoteattr(text)}' for key, text in values.items())}>{within}</{element.tag}>"

    def _mesh(self, filename: str) -> str:
        """The path of a mesh, looked for as PyBullet does: in the folders above the file."""
        name = filename.removeprefix(PACKAGES[0]).removeprefix(PACKAGES[1])
        places = [Path.cwd(), *self.path.resolve().parents]
        return next((str(place / name) for place in places if (place / name).is_file()), name)

    def number_of_objects(self, mesh: Element) -> int:
        """How many objects or groups of an OBJ file have faces; 1 of another file, or of one that is not found."""
        path, found, is_new = Path(self._mesh(mesh.attributes.get("filename", ""))), 0, True
        if path.suffix.lower() != ".obj" or not path.is_file():
            return 1
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            found += is_new and line.startswith("f ")
            is_new = line.startswith(("o ", "g ")) or (is_new and not line.startswith("f "))
        return found


def package_remedy(source: Element) -> str:
    """The end of a sentence on a mesh that is not found: what to do with the first path in a package; empty if there is none."""
    for mesh in source.every("mesh"):
        for beginning in PACKAGES:
            if mesh.attributes.get("filename", "").startswith(beginning):
                return f"; replace {beginning} in line {mesh.line} by the path of the folder that has the package"
    return ""


def verify_one_root(source: Element, given: str) -> None:
    """Refuse a URDF file that does not have exactly one root link: PyBullet ends the process, MuJoCo welds all roots to the world.

    Raises:
        DropspinError: It has another number of them.
    """
    parents = _parents(source)
    names = [printable(link.attributes.get("name", "")) for link in source.children if link.tag == "link"]
    roots = [name for name in names if name not in parents]
    if len(roots) != 1:
        raise DropspinError(f"{given}: has {len(roots)} links without a parent ({', '.join(roots[:5])}); a URDF file has one.")


def _parents(source: Element) -> dict[str, Element]:
    """The joint between each link and its parent, by the name of the link."""
    return {_end(joint, "child"): joint for joint in source.children if joint.tag == "joint"}


def used_by_neither_engine(link: Element) -> Iterator[Element]:
    """The settings of a link's contacts that MuJoCo and PyBullet do not use, those in <gazebo> elements of the file too."""
    name, robot = link.attributes.get("name"), link.parent
    yield from link.every(*UNUSED)
    for element in [] if robot is None else robot.children:
        if element.tag == "gazebo" and element.attributes.get("reference", name) == name:
            yield from element.every(*UNUSED)


def without_collision(link: Element) -> Iterator[Ignored]:
    """That a link has visual geometries alone."""
    if next(link.every("collision"), None) is None and next(link.every("visual"), None) is not None:
        yield "collision", link.words, "missing: the link collides with nothing"


def _end(joint: Element, which: str) -> str:
    """The parent or the child of a joint."""
    return printable(next((end.attributes.get("link", "") for end in joint.every(which)), ""))


def _is_heavy(link: Element) -> bool:
    """Whether PyBullet gives a link mass: 1 kg if none is written."""
    mass = next(link.every("mass"), None)
    return mass.number("value", 1.0) > 0.0 if mass is not None else link.attributes.get("name") != "world"

"""The elements of an MJCF or URDF file that the bodies, geometries and contact pairs of the compiled model come from."""

from collections.abc import Iterator, Sequence

import mujoco

from dropspin.comparisons.diagnosis.mujoco_file import BODY, GEOM, MuJoCoFile
from dropspin.comparisons.diagnosis.xml_file import Element


def body_element(file: MuJoCoFile, number: int) -> Element | None:
    """A body in the file: by its name, or by its place if the file has as many bodies as the model, those of a replicate counted."""
    bodies = list(_compiled(file.source, "link" if file.is_urdf else "body"))
    placed = bodies[number - 1] if len(bodies) == file.model.nbody - 1 else None
    return _named(bodies, mujoco.mj_id2name(file.model, BODY, number), placed)


def geom_element(file: MuJoCoFile, number: int) -> Element | None:
    """A geometry in the file: by its name, or by its place if its body has as many geometries in the file as in the model."""
    every, body = list(file.source.every("geom")), int(file.model.geom_bodyid[number])
    owners = [body_element(file, body)] if body else list(file.source.every("worldbody"))
    of_body = [geom for owner in owners if owner is not None for geom in _compiled(owner, "geom") if owner_of(geom) is owner]
    place, added = number - int(file.model.body_geomadr[body]), body == 0  # the plane that is added to the world, its last geometry
    placed = of_body[place] if place < len(of_body) == file.model.body_geomnum[body] - added else None
    return _named(every, mujoco.mj_id2name(file.model, GEOM, number), placed)


def _compiled(element: Element, tag: str) -> Iterator[Element]:
    """The elements of a tag within one, as often as MuJoCo compiles them: those within a `replicate` several times."""
    for child in element.children:
        yield from [child] if child.tag == tag else []
        for _ in range(int(child.attributes.get("count", 1)) if child.tag == "replicate" else 1):
            yield from _compiled(child, tag)


def _named(elements: Sequence[Element], name: str | None, placed: Element | None) -> Element | None:
    """The first of some elements that has a name, or else the one in its place."""
    return next((element for element in elements if name and element.attributes.get("name") == name), placed)


def pair_element(file: MuJoCoFile, *geoms: int) -> Element | None:
    """The pair of an MJCF file that sets the contact of two geometries; None if they have none."""
    names = {mujoco.mj_id2name(file.model, GEOM, geom) for geom in geoms}
    return next((pair for pair in file.source.every("pair") if {pair.attributes.get(name) for name in ("geom1", "geom2")} == names), None)


def children_of(body: Element, *tags: str) -> list[Element]:
    """The elements of a body that have one of the tags, also those within frames, and not those of its children."""
    return [element for element in body.every(*tags) if owner_of(element) is body]


def owner_of(element: Element) -> Element | None:
    """The body, or link, that an element is part of, also if it is within frames."""
    return next((one for one in element.around if one.tag in ("body", "worldbody", "link")), None)

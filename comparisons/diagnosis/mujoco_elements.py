"""The elements of an MJCF or URDF file that the bodies, geometries and contact pairs of the compiled model come from."""

from collections.abc import Sequence

import mujoco

from dropspin.comparisons.diagnosis.mujoco_file import BODY, GEOM, MuJoCoFile
from dropspin.comparisons.diagnosis.xml_file import Element


def body_element(file: MuJoCoFile, number: int) -> Element | None:
    """A body in the file: by its name, or by its place if the file has as many bodies as the model."""
    bodies = list(file.source.every("link" if file.is_urdf else "body"))
    placed = bodies[number - 1] if len(bodies) == file.model.nbody - 1 else None
    return _named(bodies, mujoco.mj_id2name(file.model, BODY, number), placed)


def geom_element(file: MuJoCoFile, number: int) -> Element | None:
    """A geometry in the file: by its name, or by its place if its body has as many geometries in the file as in the model."""
    every, body = list(file.source.every("geom")), int(file.model.geom_bodyid[number])
    owner = body_element(file, body) if body else None
    owners = [(geom, owner_of(geom)) for geom in every]
    of_body = [geom for geom, one in owners if one is not None and (one is owner if body else one.tag == "worldbody")]
    place, added = number - int(file.model.body_geomadr[body]), body == 0  # the plane that is added to the world, its last geometry
    placed = of_body[place] if place < len(of_body) == file.model.body_geomnum[body] - added else None
    return _named(every, mujoco.mj_id2name(file.model, GEOM, number), placed)


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

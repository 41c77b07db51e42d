"""The elements of an MJCF or URDF file that the bodies, geometries and contact pairs of the compiled model come from."""

import mujoco

from dropspin.comparisons.diagnosis.mujoco_file import BODY, GEOM, MuJoCoFile
from dropspin.comparisons.diagnosis.source import Element


def body_element(file: MuJoCoFile, number: int) -> Element | None:
    """A body in the file: by its name, or by its place if the file has as many bodies as the model."""
    bodies = list(file.source.every("link" if file.is_urdf else "body"))
    name = mujoco.mj_id2name(file.model, BODY, number)
    named = [element for element in bodies if name and element.attributes.get("name") == name]
    if not named and len(bodies) == file.model.nbody - 1:
        named = bodies[number - 1 : number]
    return named[0] if named else None


def geom_element(file: MuJoCoFile, number: int) -> Element | None:
    """A geometry in the file: by its name, or by its place if its body has as many geometries in the file as in the model."""
    every, name, body = list(file.source.every("geom")), mujoco.mj_id2name(file.model, GEOM, number), int(file.model.geom_bodyid[number])
    named = [geom for geom in every if name and geom.attributes.get("name") == name]
    owner = body_element(file, body) if body else None
    owners = [(geom, owner_of(geom)) for geom in every]
    of_body = [geom for geom, one in owners if one is not None and (one is owner if body else one.tag == "worldbody")]
    if not named and len(of_body) == file.model.body_geomnum[body] - (body == 0):  # without the plane that is added to the world
        place = number - int(file.model.body_geomadr[body])
        named = of_body[place : place + 1]
    return named[0] if named else None


def pair_element(file: MuJoCoFile, *geoms: int) -> Element | None:
    """The pair of an MJCF file that sets the contact of two geometries; None if they have none."""
    names = {mujoco.mj_id2name(file.model, GEOM, geom) for geom in geoms}
    return next((pair for pair in file.source.every("pair") if {pair.attributes.get(name) for name in ("geom1", "geom2")} == names), None)


def children_of(body: Element, *tags: str) -> list[Element]:
    """The elements of a body that have one of the tags, also those within frames, and not those of its children."""
    return [element for element in body.every(*tags) if owner_of(element) is body]


def owner_of(element: Element) -> Element | None:
    """The body, or link, that an element is part of, also if it is within frames."""
    place = element.parent
    while place is not None and place.tag not in ("body", "worldbody", "link"):
        place = place.parent
    return place

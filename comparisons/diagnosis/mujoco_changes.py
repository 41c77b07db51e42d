"""What the file of a body says and MuJoCo changes or does not use."""

import math
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from dropspin.comparisons.diagnosis.answers import NOTEWORTHY, digits
from dropspin.comparisons.diagnosis.geometries import is_whole
from dropspin.comparisons.diagnosis.loose_body import LooseBody
from dropspin.comparisons.diagnosis.mjcf_defaults import option_setting
from dropspin.comparisons.diagnosis.mujoco_contacts import overrides
from dropspin.comparisons.diagnosis.mujoco_elements import children_of
from dropspin.comparisons.diagnosis.mujoco_file import ADDED, BODY
from dropspin.comparisons.diagnosis.mujoco_recompiled import NEUTRAL, with_exact_volumes, without, without_mass_of, without_visual
from dropspin.comparisons.diagnosis.mujoco_shapes import mesh_of
from dropspin.comparisons.diagnosis.mujoco_text import BodyText, differ
from dropspin.comparisons.diagnosis.urdf_file import used_by_neither_engine, without_collision
from dropspin.comparisons.diagnosis.xml_file import Ignored, Setting

IN_FORCE = {"lateral_friction": 1.0, "rolling_friction": 0.0, "spinning_friction": 0.0, "restitution": 0.0}
IN_FORCE |= {"inertia_scaling": 1.0} | dict.fromkeys(("stiffness", "damping", "friction_anchor"), math.nan)
"""The settings of inertia and contact in a URDF file, which MuJoCo does not read, and what it has instead."""
FURTHER = {"torsional": (1, 4, 0.005), "rolling": (2, 6, 1e-4)}
"""The place of a coefficient of friction, the dimensions of contacts that have it, and its default."""
PER_METRE = {"cm": 100.0, "mm": 1000.0}
"""Units of length in which models are written by mistake."""


def ignored(text: BodyText, in_force: LooseBody, *, raised: bool, condim: int) -> Iterator[Ignored]:
    """What the file says and MuJoCo changes or does not use.

    Args:
        text: The body in the words of its file.
        in_force: The body, with the mass and the inertia in force.
        raised: Whether the time constant of a contact is raised.
        condim: The dimensions of the contact with what the body lands on; 0 without one.
    """
    settings, written = text.settings, text.written
    yield from _options(text)
    if raised:
        constant = 2.0 * text.model.opt.timestep
        yield "solref", settings.get("solref", Setting("solref")), f"raised to a time constant of {constant:g} s, two time steps"
    if written is not None:
        wanted, has = np.linalg.eigvalsh(written.inertia), np.linalg.eigvalsh(in_force.inertia)
        if differ(written.mass, in_force.mass):
            yield _changed(text, "mass", f"changed: {in_force.mass:.4g} kg")
        if differ(wanted, has):
            made = f"refused ({text.file.refusal}); measured with balanceinertia" if text.file.refusal else "changed"
            made = made if wanted.any() else "0, with which MuJoCo simulates no body; measured with that of a uniform solid"
            yield _changed(text, "inertia", f"{made}: moments {digits(has.tolist())} kg m²")
    yield from _meshes(text)
    yield from _visual(text)
    if condim == 1 and "friction" in settings and settings["friction"].file:
        yield "friction", settings["friction"], "not used: condim is 1"
    frictions = {setting: _frictions(setting, text.is_paired) for setting in text.frictions if setting.file} if condim > 1 else {}
    sliding = max((own[0] for own in frictions.values()), default=math.inf)
    if sliding < in_force.friction and not text.is_paired and in_force.surface != ADDED:  # which the file has nowhere
        made = f"not used for a slide: that of the other geometry, {in_force.friction:g}, is larger"
        yield "friction", next(iter(frictions)), made
    for setting, own in frictions.items():
        if unused := [name for name, (place, least, most) in FURTHER.items() if condim < least and own[place] > most]:
            needed = " and ".join(f"{name} friction needs condim {FURTHER[name][1]}" for name in unused)
            is_first = setting == settings.get("friction")
            yield "friction" if is_first else f"friction in line {setting.line}", setting, f"used in part: {needed}, and condim is {condim}"
    if text.file.is_urdf:
        element = text.element
        if text.model.body_weldid[text.head] == 0:
            yield "base", Setting("the root link") if element is None else element.words, "welded to the world"
        yield from _of_links(text)


def _options(text: BodyText) -> Iterator[Ignored]:
    """Options of the file that are in other units, or that a flag disables or would have to enable."""
    source, gravity = text.file.source, float(np.linalg.norm(text.file.gravity))
    for unit, factor in PER_METRE.items():
        if math.isclose(gravity, 9.81 * factor, rel_tol=NOTEWORTHY):
            setting = option_setting(source, "option", "gravity", "")
            yield "gravity", setting, f"taken as {gravity:g} m/s²; dropspin reads SI units, and this may be a model in {unit}"
    if np.any(text.model.opt.gravity) and not gravity:
        yield "gravity", option_setting(source, "flag", "gravity", ""), "not used"
    for name in () if overrides(text.model) else ("o_solref", "o_solimp", "o_friction", "o_margin"):
        if (setting := option_setting(source, "option", name, "")).file:
            yield name, setting, "not used: the flag override is not set"


def _frictions(written: Setting, of_pair: bool) -> list[float]:
    """The coefficients of friction that the file has for a slide, torsion and rolling; 0 for those that it has not."""
    numbers = list(map(float, written.text.partition('"')[2].strip('"').split()))
    if of_pair or len(numbers) == 5:  # as in an option for all contacts: two slide
        del numbers[1:2]
    return (numbers + 3 * [0.0])[:3]


def _meshes(text: BodyText) -> Iterator[Ignored]:
    """Meshes of the body that are read in part, and a mass that is not that of their volumes."""
    model = text.model
    geoms = [int(geom) for geom in np.flatnonzero(np.isin(model.geom_bodyid, text.group)) if model.geom_dataid[geom] >= 0]
    names = {geom: mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_MESH, model.geom_dataid[geom]) for geom in geoms}

    def words(*used: str) -> Setting:
        every, key = list(text.file.source.every("mesh")), "filename" if text.file.is_urdf else "file"
        meshes = [mesh for mesh in every if mesh.attributes.get("name", Path(mesh.attributes.get(key, "")).stem) in used]
        return meshes[0].words if meshes else Setting("a mesh")

    has, exact = text.properties(text.file.compiled), text.properties(with_exact_volumes(text.file.spec))
    for geom, name in names.items():
        points, faces = mesh_of(model, geom)
        if is_whole(points, faces):
            continue
        rest = text.properties(without_mass_of(text.file.spec, geom))
        if rest is None or has is None or differ(rest.mass, has.mass):
            made = "but mass and inertia are those of the first object of its file"
            yield "mesh", words(name), f"read in part: all of its {len(points)} vertices collide, {made}"
    if has is not None and exact is not None and abs(more := has.mass - exact.mass) > NOTEWORTHY * exact.mass:
        made = f"counted with {abs(more):.4g} kg {'more' if more > 0.0 else 'less'} than its volume has"
        yield "mesh", words(*names.values()), f'{made}, which inertia="exact" counts'


def _of_links(text: BodyText) -> Iterator[Ignored]:
    """Of the links in a URDF file: a mass that follows from the geometries, and settings of contacts."""
    links = {link.attributes.get("name", ""): link for link in text.file.source.every("link")}
    names = {number: mujoco.mj_id2name(text.model, BODY, number) for number in text.group}
    own = {number: links[name] for number, name in names.items() if name in links}
    collides = any(next(link.every("collision"), None) for link in own.values())
    for number, link in own.items():
        if (mass := text.model.body_mass[number]) > 0.0 and next(link.every("inertial"), None) is None:
            words = Setting(f"no inertial in link {names[number]}", link.file, link.line)
            yield "inertial", words, f"missing: the mass is {mass:.4g} kg, that of the geometries at the default density"
        unread = [found for tag, value in IN_FORCE.items() for found in link.every(tag) if found.number("value", value) != value]
        of_link = "" if number == text.head else f" of {names[number]}"
        for found in (*unread, *used_by_neither_engine(link)):
            yield found.tag + of_link, found.words, "not read"
        for key, words, made in () if collides else without_collision(link):
            yield key + of_link, words, made


def _visual(text: BodyText) -> Iterator[Ignored]:
    """Geometries that collide with nothing, and count in the mass by their density."""
    has, least = text.properties(text.file.compiled), text.properties(without_visual(text.file.spec))
    if text.element is None or has is None or least is None or not has.mass - least.mass > NOTEWORTHY * has.mass:
        return
    elements, geoms = children_of(text.element, "geom"), [geom for geom in text.file.spec.geoms if geom.parent.id == text.head]
    pairs = zip(geoms, elements, strict=True) if len(geoms) == len(elements) else ()
    visual = [element for geom, element in pairs if not (geom.contype or geom.conaffinity) and math.isnan(geom.mass)]
    words = visual[0].words if visual else Setting("geometries that collide with nothing")
    yield "visual", words, f"counted in the mass with {has.mass - least.mass:.4g} kg, by density, although it collides with nothing"


def _changed(text: BodyText, name: str, made: str) -> Ignored:
    """A quantity that the compiler changes, with what is written, and the settings that do so, that of the largest effect first."""
    found = {setting: option_setting(text.file.source, "compiler", setting, "") for setting in (*NEUTRAL, "balanceinertia")}
    effects = {setting: _effect(text, setting, name) for setting, words in found.items() if words.file}
    why = [found[setting] for setting in sorted(effects, key=effects.__getitem__, reverse=True) if effects[setting]]
    first = [one for one in [text.settings.get(name)] if one] or why[:1] or [Setting(name)]
    others = [str(one) for one in why if one not in first]
    return name, first[0], made + (f", by {', '.join(others)}" if others else "")


def _effect(text: BodyText, setting: str, name: str) -> float:
    """By how much a setting of the compiler alone changes a quantity, in its unit; 0 for rounding."""
    if setting == "balanceinertia":
        neutral, has = text.written, text.unchanged
    else:
        neutral, has = (text.properties(one) for one in (without(text.file.spec, setting), text.file.compiled))
    if neutral is None or has is None or not differ(getattr(neutral, name), getattr(has, name)):
        return 0.0
    return float(np.abs(np.subtract(getattr(neutral, name), getattr(has, name))).max())

"""A body of an MJCF or URDF file in the file's own words: its settings with their lines, and what MuJoCo changes or does not use."""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.diagnosis.answers import NOTEWORTHY, digits
from dropspin.comparisons.diagnosis.loose_body import MassProperties
from dropspin.comparisons.diagnosis.mujoco_compiled import mass_properties
from dropspin.comparisons.diagnosis.mujoco_contacts import overrides
from dropspin.comparisons.diagnosis.mujoco_elements import body_element, children_of, geom_element, pair_element
from dropspin.comparisons.diagnosis.mujoco_file import BODY, MuJoCoFile
from dropspin.comparisons.diagnosis.mujoco_recompiled import NEUTRAL
from dropspin.comparisons.diagnosis.source import Element, Ignored, Setting, mjcf_setting, option_setting, tagged
from dropspin.comparisons.diagnosis.urdf_file import used_by_neither_engine
from dropspin.comparisons.engines.mujoco_settings import OF_GEOM
from dropspin.scenarios.bodies.inertia import OF_URDF, symmetric
from dropspin.scenarios.state import Array

OF_JOINT = ("damping", "armature", "frictionloss")
SAME = 1e-6
"""Relative difference up to which a moment of inertia is the one that was written."""
IN_FORCE = {"lateral_friction": 1.0, "rolling_friction": 0.0, "spinning_friction": 0.0, "restitution": 0.0}
IN_FORCE |= {"inertia_scaling": 1.0} | dict.fromkeys(("stiffness", "damping", "friction_anchor"), math.nan)
"""The settings of inertia and contact in a URDF file, which MuJoCo does not read, and what it has instead."""
FURTHER = {"torsional": (1, 4, 0.005), "rolling": (2, 6, 1e-4)}
"""The place of a coefficient of friction, the dimensions of contacts that have it, and its default."""
PER_METRE = {"cm": 100.0, "mm": 1000.0}
"""Units of length in which models are written by mistake."""


class BodyText:
    """What a file says of a body.

    Args:
        file: The file.
        head: The number of the body.
        surface: The number of the geometry that it lands on.
        touching: The numbers of the geometries that touch it.
        contacts: The settings of the contacts with it, by the numbers of all geometries that collide with it.
    """

    def __init__(
        self, file: MuJoCoFile, head: int, surface: int | None, touching: Sequence[int], contacts: Mapping[int, Mapping[str, Any]]
    ) -> None:
        self._file, self._head, self._surface, self._touching, self._contacts = file, head, surface, touching, contacts
        self._model, self._group = file.model, file.group(head)

    @cached_property
    def element(self) -> Element | None:
        """The body in the file."""
        return body_element(self._file, self._head)

    @cached_property
    def _bodies(self) -> list[Element]:
        """The body and what is welded to it, in the file."""
        return list(filter(None, (body_element(self._file, body) for body in self._group)))

    @cached_property
    def written(self) -> MassProperties | None:
        """What the file says of the body and of what is welded to it, with moments that MuJoCo would balance as they are written."""
        tensor = self._tensor
        found = self._unchanged
        if found is None or tensor is None:
            return found
        wanted, has = np.linalg.eigvalsh(tensor), np.linalg.eigvalsh(found.inertia)
        return found._replace(inertia=tensor) if _differ(wanted, has) else found

    @property
    def _unchanged(self) -> MassProperties | None:
        """Those that the file has before the compiler changes them; impossible ones are balanced."""
        return self._properties(self._file.recompiled.without(*NEUTRAL))

    def _properties(self, compiled: tuple[Any, Any] | None) -> MassProperties | None:
        """Those of the body and of what is welded to it in a compiled model with its data; None without mass or without a model."""
        return None if compiled is None else mass_properties(*compiled, self._group)

    @cached_property
    def _tensor(self) -> Array | None:
        """The tensor that is written for a body to which nothing is welded, about the axes of its inertial frame."""
        inertial = None if self.element is None else next(iter(children_of(self.element, "inertial")), None)
        if inertial is None or len(self._group) > 1:
            return None
        values = inertial.attributes
        if self._file.is_urdf:
            values = next(inertial.every("inertia"), inertial).attributes
            numbers = [float(values.get(name, 0.0)) for name in OF_URDF]
        else:
            numbers = list(map(float, values.get("diaginertia", values.get("fullinertia", "")).split()))
        return np.array(symmetric([*numbers, 0.0, 0.0, 0.0][:6])) if numbers else None

    @cached_property
    def settings(self) -> dict[str, Setting]:
        """The settings that matter, in the words of the file."""
        root, body = self._file.source, self.element
        options = {"timestep": "0.002", "integrator": "Euler", "cone": "pyramidal", "impratio": "1", "density": "0", "viscosity": "0"}
        found = {name: option_setting(root, "option", name, default) for name, default in options.items()}
        found["sleep_tolerance"] = option_setting(root, "flag", "sleep", "disable")
        of_all = {name: option_setting(root, "option", f"o_{name}", "") for name in overrides(self._model)}
        if body is None:
            return found
        places: dict[str, list[Element]] = {"gravcomp": self._bodies} | dict.fromkeys(OF_JOINT, self._joint)
        places |= dict.fromkeys(("margin", "contype", "conaffinity"), self._elements(self._in_contact))
        places |= dict.fromkeys(("solref", "solimp", "friction", "condim"), self._elements(self._of_priority))
        inertial = next(iter(children_of(body, "inertial")), None)
        written = {name: [mjcf_setting(one, name) for one in elements] for name, elements in places.items()}
        if inertial is not None:
            tensor = next(inertial.every("inertia"), None)  # of URDF
            names = ("diaginertia", "fullinertia", "mass")
            written["mass"] = [inertial.setting("mass") or next((one.words for one in inertial.every("mass")), None)]
            written["centre"] = [inertial.setting("pos") or next((one.words for one in inertial.every("origin")), inertial.words)]
            written["inertia"] = [inertial.setting(name) for name in names] if tensor is None else [tensor.words]
        # Of several places, the first one counts.
        return found | {name: one for name, several in written.items() for one in reversed(several) if one} | of_all

    @cached_property
    def _joint(self) -> list[Element]:
        """The joint of the body."""
        return [] if self.element is None else children_of(self.element, "joint", "freejoint")[:1]

    @property
    def _in_contact(self) -> list[int]:
        """The geometries that touch, or all if none does, and the one that the body lands on."""
        touching = list(self._touching) or [geom for geom, body in enumerate(self._model.geom_bodyid) if body in self._group]
        return touching if self._surface is None else [*touching, self._surface]

    @property
    def _of_priority(self) -> list[int]:
        """Those of the largest priority, whose settings of the contact count alone."""
        priorities = self._model.geom_priority[self._in_contact]
        return [geom for geom, priority in zip(self._in_contact, priorities, strict=True) if priority == priorities.max()]

    def _elements(self, geoms: Sequence[int]) -> list[Element]:
        """The elements that set a contact: the pairs, and those of geometries."""
        pairs = [self._pair(geom) for geom in self._touching]
        return list(filter(None, [*pairs, *(geom_element(self._file, geom) for geom in geoms)]))

    def _pair(self, geom: int) -> Element | None:
        """The pair of the file that sets the contact of a geometry."""
        return None if self._surface is None else pair_element(self._file, geom, self._surface)

    def patch(self, options: Mapping[str, object], others: Mapping[str, object]) -> str:
        """Elements to write for changes of options, and of the joint, the geometries and the body: changed ones with their lines.

        Args:
            options: New values of options of the model.
            others: New values of other settings.
        """
        found: list[Setting | str] = []
        if options:
            element = next(reversed(list(self._file.source.every("option"))), None)
            within = next(self._file.source.every("mujoco"), None)
            bare = f"{tagged('option', options)}/>"
            if element is None and within is not None:
                bare += f" within {within.words}"
            elif self._file.is_urdf:
                bare = f"<mujoco>{bare}</mujoco>"
            found.append(element.changed(options) if element else bare)
        if "damping" in others:
            found += [self._freed(joint) for joint in self._joint] or ["<freejoint/>"]
        elif of_joint := {name: value for name, value in others.items() if name in OF_JOINT}:
            found += [joint.changed(of_joint) for joint in self._joint]
        if "gravcomp" in others:
            found += [body.changed({"gravcomp": others["gravcomp"]}) for body in self._bodies if "gravcomp" in body.attributes]
        if contact := {name: value for name, value in others.items() if name in ("solref", "solimp", "margin")}:
            found += self._with_contact(contact)
        return ", ".join(map(str, found)) or " ".join(f'{name}="{value}"' for name, value in others.items())

    def _freed(self, joint: Element) -> Setting:
        """A free joint in place of a joint, with what others may refer to it by."""
        kept = {name: value for name, value in joint.attributes.items() if name in ("name", "group")}
        return Setting(f"{tagged('freejoint', kept)}/>", joint.file, joint.line)

    def _with_contact(self, changes: Mapping[str, object]) -> list[Setting]:
        """The pairs, and geometries without one, with other settings: margins add, of others those of the larger priority count alone."""
        pairs = {number: pair for number in self._contacts if (pair := self._pair(number)) is not None}
        found = [pair.changed(changes) for pair in pairs.values()]
        alone = [number for number in self._contacts if number not in pairs]
        if "margin" in changes:
            elements = filter(None, (geom_element(self._file, geom) for geom in (*alone, self._surface) if alone and geom is not None))
            return found + [geom.changed({"margin": 0}) for geom in elements if mjcf_setting(geom, "margin") is not None]
        for number in alone:
            contact = self._contacts[number]
            kept = {"friction": contact["friction"][OF_GEOM], "condim": np.array([contact["condim"]])}
            kept = {name: value for name, value in kept.items() if np.any(value != getattr(self._model, f"geom_{name}")[number])}
            texts = {name: " ".join(f"{one:g}" for one in value) for name, value in kept.items()}
            priority = 1 + self._model.geom_priority[[number, self._surface]].max()
            element = geom_element(self._file, number)
            found += [] if element is None else [element.changed({**changes, "priority": priority, **texts})]
        return found

    def ignored(self, in_force: MassProperties, *, raised: bool, condim: int) -> Iterator[Ignored]:
        """What the file says and MuJoCo changes or does not use.

        Args:
            in_force: The mass and the inertia in force.
            raised: Whether the time constant of a contact is raised.
            condim: The dimensions of the contact with what the body lands on; 0 without one.
        """
        settings, written, gravity = self.settings, self.written, float(np.linalg.norm(self._file.gravity))
        for unit, factor in PER_METRE.items():
            if math.isclose(gravity, 9.81 * factor, rel_tol=NOTEWORTHY):
                setting = option_setting(self._file.source, "option", "gravity", "")
                yield "gravity", setting, f"taken as {gravity:g} m/s²; dropspin reads SI units, and this may be a model in {unit}"
        if raised:
            constant = 2.0 * self._model.opt.timestep
            yield "solref", settings.get("solref", Setting("solref")), f"raised to a time constant of {constant:g} s, two time steps"
        if written is not None:
            wanted, has = np.linalg.eigvalsh(written.inertia), np.linalg.eigvalsh(in_force.inertia)
            if _differ(written.mass, in_force.mass):
                yield self._changed("mass", f"changed: {in_force.mass:.4g} kg")
            if _differ(wanted, has):
                made = f"refused ({self._file.refusal}); measured with balanceinertia" if self._file.refusal else "changed"
                made = made if wanted.any() else "0, with which MuJoCo simulates no body; measured with that of a uniform solid"
                yield self._changed("inertia", f"{made}: moments {digits(has.tolist())} kg m²")
        yield from self._miscounted()
        yield from self._visual()
        if condim == 1 and "friction" in settings:
            yield "friction", settings["friction"], "not used: condim is 1"
        elif condim and (
            unused := [name for name, (place, least, most) in FURTHER.items() if condim < least and self._friction(place) > most]
        ):
            needed = " and ".join(f"{name} friction needs condim {FURTHER[name][1]}" for name in unused)
            yield "friction", settings["friction"], f"used in part: {needed}, and condim is {condim}"
        if self._file.is_urdf:
            element = self.element
            if self._model.body_weldid[self._head] == 0:
                yield "base", Setting("the root link") if element is None else element.words, "welded to the world"
            yield from self._of_links()

    def _friction(self, place: int) -> float:
        """A coefficient of friction that the file has; 0 if it has none in this place."""
        written = self.settings.get("friction")
        numbers = written.text.partition('"')[2].strip('"').split() if written else []
        place += len(numbers) == 5  # the coefficients of a pair, two of them sliding
        return float(numbers[place]) if len(numbers) > place else 0.0

    def _miscounted(self) -> Iterator[Ignored]:
        """A mass that is not that of the volumes of the body's meshes."""
        has, exact = self._properties(self._file.compiled), self._properties(self._file.recompiled.exact)
        if has is not None and exact is not None and abs(has.mass - exact.mass) > NOTEWORTHY * exact.mass:
            used = {
                mujoco.mj_id2name(self._model, mujoco.mjtObj.mjOBJ_MESH, self._model.geom_dataid[geom])
                for geom in np.flatnonzero(np.isin(self._model.geom_bodyid, self._group))
                if self._model.geom_dataid[geom] >= 0
            }
            every = list(self._file.source.every("mesh"))
            meshes = [mesh for mesh in every if mesh.attributes.get("name", Path(mesh.attributes.get("file", "")).stem) in used]
            made = f'counted as {has.mass:.4g} kg by default; its volume has {exact.mass:.4g} kg, which inertia="exact" gives'
            yield "mesh", meshes[0].words if meshes else Setting("a mesh"), made

    def _of_links(self) -> Iterator[Ignored]:
        """Of the links in a URDF file: a mass that follows from the geometries, and settings of contacts."""
        links = {link.attributes.get("name", ""): link for link in self._file.source.every("link")}
        for number in self._group:
            if (link := links.get(name := mujoco.mj_id2name(self._model, BODY, number))) is None:
                continue
            if (mass := self._model.body_mass[number]) > 0.0 and next(link.every("inertial"), None) is None:
                words = Setting(f"no inertial in link {name}", link.file, link.line)
                yield "inertial", words, f"missing: the mass is {mass:.4g} kg, that of the geometries at the default density"
            unread = [found for tag, value in IN_FORCE.items() for found in link.every(tag) if found.number("value", value) != value]
            for found in (*unread, *used_by_neither_engine(link)):
                yield found.tag + ("" if number == self._head else f" of {name}"), found.words, "not read"

    def _visual(self) -> Iterator[Ignored]:
        """Geometries that collide with nothing, and count in the mass by their density."""
        has, least = self._properties(self._file.compiled), self._properties(self._file.recompiled.without_visual)
        if self.element is None or has is None or least is None or not has.mass - least.mass > NOTEWORTHY * has.mass:
            return
        model, elements = self._model, children_of(self.element, "geom")
        geoms = np.flatnonzero(model.geom_bodyid == self._head)
        pairs = zip(geoms, elements, strict=True) if len(geoms) == len(elements) else ()
        visual = [element for geom, element in pairs if not (model.geom_contype[geom] or model.geom_conaffinity[geom])]
        words = visual[0].words if visual else Setting("geometries that collide with nothing")
        yield "visual", words, f"counted in the mass with {has.mass - least.mass:.4g} kg, by density, although it collides with nothing"

    def _changed(self, name: str, made: str) -> Ignored:
        """A quantity that the compiler changes, with what is written, and the settings that do so, that of the largest effect first."""
        found = {setting: option_setting(self._file.source, "compiler", setting, "") for setting in (*NEUTRAL, "balanceinertia")}
        effects = {setting: self._effect(setting, name) for setting, words in found.items() if words.file}
        why = [found[setting] for setting in sorted(effects, key=effects.__getitem__, reverse=True) if effects[setting]]
        first = [one for one in [self.settings.get(name)] if one] or why[:1] or [Setting(name)]
        others = [str(one) for one in why if one not in first]
        return name, first[0], made + (f", by {', '.join(others)}" if others else "")

    def _effect(self, setting: str, name: str) -> float:
        """By how much a setting of the compiler alone changes a quantity, in its unit; 0 for rounding."""
        if setting == "balanceinertia":
            without, has = self.written, self._unchanged
        else:
            without, has = (self._properties(one) for one in (self._file.recompiled.without(setting), self._file.compiled))
        if without is None or has is None or not _differ(getattr(without, name), getattr(has, name)):
            return 0.0
        return float(np.abs(np.subtract(getattr(without, name), getattr(has, name))).max())


def _differ(wanted: Any, has: Any) -> bool:
    """Whether numbers differ by more than rounding from those that were written."""
    return bool(np.abs(np.subtract(wanted, has)).max() > SAME * np.abs(wanted).max())

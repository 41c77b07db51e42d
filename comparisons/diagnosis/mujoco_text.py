"""A body of an MJCF or URDF file in the file's own words: its mass, its settings with their lines, and how to change them."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.diagnosis.loose_body import MassProperties
from dropspin.comparisons.diagnosis.mjcf_defaults import mjcf_setting, option_setting
from dropspin.comparisons.diagnosis.mujoco_alone import OF_CONTACT, MuJoCoAlone
from dropspin.comparisons.diagnosis.mujoco_compiled import mass_properties
from dropspin.comparisons.diagnosis.mujoco_contacts import effect_of, overrides, with_friction
from dropspin.comparisons.diagnosis.mujoco_elements import body_element, children_of, geom_element, pair_element
from dropspin.comparisons.diagnosis.mujoco_file import BODY, GEOM
from dropspin.comparisons.diagnosis.mujoco_options import FLAGS
from dropspin.comparisons.diagnosis.mujoco_recompiled import NEUTRAL, without
from dropspin.comparisons.diagnosis.xml_file import Element, Setting, tagged
from dropspin.comparisons.engines.mujoco_settings import OF_GEOM, OPTION
from dropspin.comparisons.engines.settings import spelled
from dropspin.scenarios.bodies.inertia import OF_URDF, symmetric
from dropspin.scenarios.state import Array
from dropspin.scenarios.text import printable

OF_MODEL = ("cone", "impratio", "density", "viscosity", "wind", "iterations", "ls_iterations", "tolerance")
TURNS = ("quat", "axisangle", "xyaxes", "zaxis", "euler", "rpy")
OF_JOINT = ("damping", "armature", "frictionloss")
SAME = 1e-6
"""Relative difference up to which a moment of inertia is the one that was written."""


class BodyText:
    """What a file says of a body.

    Args:
        alone: The body, and what it lands on.
        touching: The settings of the contacts with it, by the numbers of the geometries that touch it.
    """

    def __init__(self, alone: MuJoCoAlone, touching: Mapping[int, Mapping[str, Any]]) -> None:
        self.file, self.model, self.head, self.group = alone.file, alone.file.model, alone.head, alone.group
        self._surface, self._touching, self._is_free = alone.surface, touching, alone.dof is not None
        self._contacts = {**touching, **{geom: alone.in_force_of(geom) for geom in alone.pairs if geom not in touching}}

    @cached_property
    def element(self) -> Element | None:
        """The body in the file."""
        return body_element(self.file, self.head)

    @cached_property
    def _bodies(self) -> list[Element]:
        """The body and what is welded to it, in the file."""
        return list(filter(None, (body_element(self.file, body) for body in self.group)))

    @cached_property
    def written(self) -> MassProperties | None:
        """What the file says of the body and of what is welded to it, with moments that MuJoCo would balance as they are written."""
        tensor = self.in_own_frame
        found = self.unchanged
        if found is None or tensor is None:
            return found
        wanted, has = np.linalg.eigvalsh(tensor), np.linalg.eigvalsh(found.inertia)
        return found._replace(inertia=tensor) if differ(wanted, has) else found

    @property
    def unchanged(self) -> MassProperties | None:
        """Those that the file has before the compiler changes them; impossible ones are balanced."""
        return self.properties(without(self.file.spec, *NEUTRAL))

    def properties(self, compiled: tuple[Any, Any] | None) -> MassProperties | None:
        """Those of the body and of what is welded to it in a compiled model with its data; None without mass or without a model."""
        return None if compiled is None else mass_properties(*compiled, self.group)

    @cached_property
    def in_own_frame(self) -> Array | None:
        """The tensor that is written for a body to which nothing is welded, about the axes of its inertial frame."""
        inertial = None if self.element is None else next(iter(children_of(self.element, "inertial")), None)
        if inertial is None or len(self.group) > 1:
            return None
        values = inertial.attributes
        if self.file.is_urdf:
            values = next(inertial.every("inertia"), inertial).attributes
            numbers = [float(values.get(name, 0.0)) for name in OF_URDF]
        else:
            numbers = list(map(float, values.get("diaginertia", values.get("fullinertia", "")).split()))
        return np.array(symmetric([*numbers, 0.0, 0.0, 0.0][:6])) if numbers else None

    @cached_property
    def settings(self) -> dict[str, Setting]:
        """The settings that matter, in the words of the file."""
        root, body = self.file.source, self.element
        options = {"timestep": "0.002", "integrator": "Euler"} | {name: spelled(OPTION[name].default) for name in OF_MODEL}
        found = {name: option_setting(root, "option", name, default) for name, default in options.items()}
        found |= {"sleep_tolerance": option_setting(root, "flag", "sleep", "disable")}
        found |= {name: option_setting(root, "flag", name, default) for name, (_, _, default) in FLAGS.items()}
        of_all = {name: option_setting(root, "option", f"o_{name}", "") for name in overrides(self.model)}
        if body is None:
            return found
        places: dict[str, list[Element]] = {"gravcomp": self._bodies} | dict.fromkeys(OF_JOINT, self._joint)
        places |= dict.fromkeys(("contype", "conaffinity"), self._elements(self._in_contact))
        places |= {name: self._elements(self._deciding(name)) for name in ("solref", "solimp", "friction", "condim")}
        inertial = next(iter(children_of(body, "inertial")), None)
        written = {name: [mjcf_setting(one, name) for one in elements] for name, elements in places.items()}
        if inertial is not None:
            tensor = next(inertial.every("inertia"), None)  # of URDF
            names = ("diaginertia", "fullinertia", "mass")
            written["mass"] = [inertial.setting("mass") or next((one.words for one in inertial.every("mass")), None)]
            written["centre"] = [inertial.setting("pos") or next((one.words for one in inertial.every("origin")), inertial.words)]
            written["turn"] = [one.setting(name) for one in (inertial, *inertial.every("origin")) for name in TURNS]
            written["inertia"] = [inertial.setting(name) for name in names] if tensor is None else [tensor.words]
        written["margin"] = [self._margin]
        # Of several places, the first one counts.
        return found | {name: one for name, several in written.items() for one in reversed(several) if one} | of_all

    @property
    def _margin(self) -> Setting | None:
        """The margins of the body and of the surface, which add, in the order of their sizes; or that of a pair."""
        deciding = self._deciding("margin")
        one_each = {geom == self._surface: geom for geom in reversed(deciding)}.values()
        elements = self._elements([geom for geom in deciding if geom in one_each])
        found = {one: element.tag == "pair" for element in elements if (one := mjcf_setting(element, "margin"))}
        if not found:
            return None
        *others, last = list(found)[: 1 if any(found.values()) else None]
        return last._replace(text=", ".join([*map(str, others), last.text]))

    @cached_property
    def _joint(self) -> list[Element]:
        """The free joint of the body; none of a link that is cut loose."""
        return [] if self.element is None or not self._is_free else children_of(self.element, "joint", "freejoint")[:1]

    @property
    def _in_contact(self) -> list[int]:
        """The geometries that touch, or all if none does, and the one that the body lands on."""
        touching = list(self._touching) or [geom for geom, body in enumerate(self.model.geom_bodyid) if body in self.group]
        return touching if self._surface is None else [*touching, self._surface]

    def _deciding(self, name: str) -> list[int]:
        """The geometries whose setting changes the one in force, the largest change first; all of the largest priority if none does."""
        touching, priorities = list(self._in_contact), self.model.geom_priority
        if self._surface is None:
            return touching
        pairs = [pair for geom in touching if geom != self._surface for pair in ((geom, self._surface), (self._surface, geom))]
        effects = {one: max(effect_of(self.model, name, *pair) for pair in pairs if pair[0] == one) for one in touching}
        first = sorted(touching, key=effects.__getitem__, reverse=True)
        return [geom for geom in first if effects[geom][0]] or [one for one in touching if priorities[one] == max(priorities[touching])]

    def _elements(self, geoms: Sequence[int]) -> list[Element]:
        """The elements that set a contact: the pairs, and those of geometries."""
        pairs = [self._pair(geom) for geom in self._touching]
        return list(filter(None, [*pairs, *(geom_element(self.file, geom) for geom in geoms)]))

    @property
    def frictions(self) -> list[Setting]:
        """Where coefficients of friction are written of which a contact may have the largest: in pairs, or else in geometries."""
        if "friction" in overrides(self.model):
            return [self.settings["friction"]]
        most = self.model.geom_priority[self._in_contact].max()
        pairs = list(filter(None, map(self._pair, self._touching)))
        geoms = [geom_element(self.file, geom) for geom in self._in_contact if self.model.geom_priority[geom] == most]
        found = [mjcf_setting(element, "friction") for element in pairs or geoms if element]
        return list(dict.fromkeys(filter(None, found)))

    @property
    def is_paired(self) -> bool:
        """Whether the contacts have settings of pairs."""
        return any(map(self._pair, self._touching))

    def _pair(self, geom: int) -> Element | None:
        """The pair of the file that sets the contact of a geometry."""
        return None if self._surface is None else pair_element(self.file, geom, self._surface)

    def patch(self, options: Mapping[str, object], others: Mapping[str, object]) -> str:
        """Elements to write for changes of options, and of the joint, the geometries and the body: changed ones with their lines.

        Args:
            options: New values of options of the model.
            others: New values of other settings.
        """
        found = self._with_options(options)
        if "damping" in others:
            found += [self._freed(joint) for joint in self._joint] or ["<freejoint/>"]
        elif of_joint := {name: value for name, value in others.items() if name in OF_JOINT}:
            found += [joint.changed(of_joint) for joint in self._joint]
        if "gravcomp" in others:
            found += [body.changed({"gravcomp": others["gravcomp"]}) for body in self._bodies if "gravcomp" in body.attributes]
        if contact := {name: value for name, value in others.items() if name in (*OF_CONTACT, "margin", "condim")}:
            found += self._with_contact(contact)
        return ", ".join(dict.fromkeys(map(str, found))) or " ".join(f'{name}="{value}"' for name, value in others.items())

    def _with_options(self, options: Mapping[str, object]) -> list[Setting | str]:
        """The elements with other options, and with another flag."""
        flags = {name: value for name, value in options.items() if name in FLAGS}
        written = [element for element in self.file.source.every("flag") if flags.keys() <= element.attributes.keys()]
        found: list[Setting | str] = [written[-1].changed(flags) if written else f"{tagged('flag', flags)}/>"] if flags else []
        if not (options := {name: value for name, value in options.items() if name not in flags}):
            return found
        element = next(reversed(list(self.file.source.every("option"))), None)
        within = next(self.file.source.every("mujoco"), None)
        bare = f"{tagged('option', options)}/>"
        if element is None and within is not None:
            bare += f" within {within.words}"
        elif self.file.is_urdf:
            bare = f"<mujoco>{bare}</mujoco>"
        return [element.changed(options) if element else bare, *found]

    def _freed(self, joint: Element) -> Setting:
        """A free joint in place of a joint, with what others may refer to it by."""
        kept = {name: value for name, value in joint.attributes.items() if name in ("name", "group")}
        return Setting(f"{tagged('freejoint', kept)}/>{joint.within}", joint.file, joint.line)

    def _with_contact(self, changes: Mapping[str, object]) -> list[Setting | str]:
        """The pairs, and geometries without one, with other settings: margins add, of others those of the larger priority count alone."""
        pairs = {number: pair for number in self._contacts if (pair := self._pair(number)) is not None}
        found: list[Setting | str] = [pair.changed(self._of_contact(number, changes)) for number, pair in pairs.items()]
        alone = [number for number in self._contacts if number not in pairs]
        if "margin" in changes:
            wide = [geom for geom in (*alone, self._surface) if alone and geom is not None and self.model.geom_margin[geom]]
            return found + [self._geom_changed(geom, {"margin": 0}) for geom in wide]
        if "solreffriction" in changes:
            return [*found, *(one for number in alone for one in self._paired(number, changes))]
        for number in alone:
            contact, own = self._contacts[number], self._of_contact(number, changes)
            if "friction" in own:
                own["friction"] = " ".join(np.array(str(own["friction"]).split())[OF_GEOM])
            kept = {**contact, "friction": contact["friction"][OF_GEOM], "condim": np.array([contact["condim"]])}
            changed = {*own, *overrides(self.model)}
            kept = {name: kept[name] for name in ("friction", "condim", "solref", "solimp") if name not in changed}
            kept = {name: value for name, value in kept.items() if np.any(value != getattr(self.model, f"geom_{name}")[number])}
            priority = 1 + self.model.geom_priority[[number, self._surface]].max()
            found.append(self._geom_changed(number, {**own, "priority": priority, **_texts(kept)}))
        return found

    def _of_contact(self, number: int, changes: Mapping[str, object]) -> dict[str, object]:
        """Changes for the contact of a geometry: a coefficient for slides with the others that it has."""
        return {**changes, **_texts(with_friction(self._contacts[number], changes["friction"]))} if "friction" in changes else {**changes}

    @property
    def can_pair(self) -> bool:
        """Whether the file can have contact pairs of the body with what it lands on, none of it copies, and no option overrides them."""
        if self._surface is None or self.file.is_urdf or overrides(self.model):
            return False
        elements = [geom_element(self.file, geom) for geom in (self._surface, *self._contacts)]
        return all(element is not None and not element.within for element in elements)

    def _paired(self, number: int, changes: Mapping[str, object]) -> Iterator[Setting | str]:
        """A contact pair of a geometry and the surface with other settings, and names for those of them that have none."""
        assert self._surface is not None  # `can_pair`
        contact, geoms = self._contacts[number], [self._surface, number]
        names = [mujoco.mj_id2name(self.model, GEOM, geom) or self._called(geom) for geom in geoms]
        for geom, name in zip(geoms, names, strict=True):
            if not mujoco.mj_id2name(self.model, GEOM, geom):
                yield self._geom_changed(geom, {"name": name})
        has_class = any(one.tag == "default" for pair in self.file.source.every("pair") for one in pair.around)
        apart = [name for name in ("margin", "gap") if has_class or contact[name]]
        kept = {name: contact[name] for name in ("friction", "condim", *apart)}
        pair = tagged("pair", {"geom1": names[0], "geom2": names[1], **_texts(kept), **self._of_contact(number, changes)})
        yield printable(f"<contact>{pair}/></contact>")

    def _geom_changed(self, number: int, changes: Mapping[str, object]) -> Setting | str:
        """A geometry with other settings; one that has no element in the file by its name or number, and that of its body."""
        if (element := geom_element(self.file, number)) is not None:
            return element.changed(changes)
        converted = " in an MJCF file (a URDF has no such settings)" if self.file.is_urdf else ""
        return printable(f"{tagged('geom', changes)}/> for {self._called(number)}") + converted

    def _called(self, number: int) -> str:
        """A geometry by its name or its place in its body, and the body by its name or number."""
        body = int(self.model.geom_bodyid[number])
        name = mujoco.mj_id2name(self.model, GEOM, number) or f"geometry {number - self.model.body_geomadr[body] + 1}"
        return f"{name} of {mujoco.mj_id2name(self.model, BODY, body) or f'body {body}'}"


def _texts(values: Mapping[str, Any]) -> dict[str, str]:
    """Numbers, and several of them, as attributes have them."""
    return {name: " ".join(f"{one:g}" for one in np.atleast_1d(value)) for name, value in values.items()}


def differ(wanted: Any, has: Any) -> bool:
    """Whether numbers differ by more than rounding from those that were written."""
    return bool(np.abs(np.subtract(wanted, has)).max() > SAME * np.abs(wanted).max())

"""A body of an MJCF or URDF file in the file's own words: its settings with their lines, and what MuJoCo changes or does not use."""

from collections.abc import Iterator, Sequence
from functools import cached_property

import mujoco
import numpy as np

from dropspin.comparisons.diagnosis.mujoco_file import BODY, GEOM, MuJoCoFile
from dropspin.comparisons.diagnosis.source import Element, Setting, mjcf_setting, option_setting
from dropspin.scenarios.bodies.inertia import OF_URDF, symmetric
from dropspin.scenarios.state import Array

SAME = 1e-6
"""Relative difference up to which a moment of inertia is the one that was written."""
IN_FORCE = {"lateral_friction": 1.0, "rolling_friction": 0.0, "spinning_friction": 0.0, "restitution": 0.0}
"""The settings of a contact in a URDF file, which MuJoCo does not read, and what it has instead."""
CHANGED_BY = ("balanceinertia", "boundinertia", "boundmass", "settotalmass", "inertiafromgeom")
"""Settings of the compiler that change the inertia of a file."""


class BodyText:
    """What a file says of a body.

    Args:
        file: The file.
        head: The number of the body.
        surface: The number of the geometry that it lands on.
    """

    def __init__(self, file: MuJoCoFile, head: int, surface: int | None) -> None:
        self._file, self._head, self._surface = file, head, surface

    @cached_property
    def element(self) -> Element | None:
        """The body in the file: by its name, or by its place if the file has as many bodies as the model."""
        bodies = list(self._file.source.every("link" if self._file.is_urdf else "body"))
        name = mujoco.mj_id2name(self._file.model, BODY, self._head)
        named = [element for element in bodies if name and element.attributes.get("name") == name]
        if not named and len(bodies) == self._file.model.nbody - 1:
            named = bodies[self._head - 1 : self._head]
        return named[0] if named else None

    @cached_property
    def written(self) -> Array | None:
        """The inertia that the file has for a body to which nothing is welded, about its own axes."""
        inertial = None if self.element is None else next(self.element.every("inertial"), None)
        if inertial is None or len(self._file.group(self._head)) > 1:
            return None
        values = inertial.attributes
        if self._file.is_urdf:
            values = next(inertial.every("inertia"), inertial).attributes
            numbers = [float(values.get(name, 0.0)) for name in OF_URDF]
        elif "diaginertia" in values:
            numbers = [*map(float, values["diaginertia"].split()), 0.0, 0.0, 0.0]
        elif "fullinertia" in values:
            numbers = [float(value) for value in values["fullinertia"].split()]
        else:
            return None
        return np.array(symmetric(numbers))

    @cached_property
    def settings(self) -> dict[str, Setting]:
        """The settings that matter, in the words of the file."""
        root, body = self._file.source, self.element
        options = {"timestep": "0.002", "integrator": "Euler", "cone": "pyramidal", "impratio": "1", "density": "0", "viscosity": "0"}
        found = {name: option_setting(root, "option", name, default) for name, default in options.items()}
        if body is None:
            return found
        joint = next((child for child in body.children if child.tag in ("joint", "freejoint")), None)
        own = [child for child in body.children if child.tag == "geom"]
        name = "" if self._surface is None else mujoco.mj_id2name(self._file.model, GEOM, self._surface)
        there = [geom for geom in root.every("geom") if geom.attributes.get("name") == name and geom not in own] if name else []
        there = there or [geom for geom in root.every("geom") if geom not in own]
        places: dict[str, list[Element | None]] = {"gravcomp": [body], "damping": [joint], "armature": [joint], "frictionloss": [joint]}
        places |= {name: [*own, *there[:1]] for name in ("margin", "solref", "solimp", "friction", "condim")}
        inertial = next(body.every("inertial"), None)
        written = {name: [mjcf_setting(one, name) for one in elements if one is not None] for name, elements in places.items()}
        if inertial is not None:
            tensor = next(inertial.every("inertia"), None)  # of URDF
            names = ("diaginertia", "fullinertia", "mass")
            written["inertia"] = [inertial.setting(name) for name in names] if tensor is None else [tensor.words]
        for name, settings in written.items():
            first = next((setting for setting in settings if setting is not None), None)
            found |= {} if first is None else {name: first}
        return found

    def ignored(self, inertia: Array, *, raised: bool) -> Iterator[tuple[str, Setting, str]]:
        """What the file says and MuJoCo changes or does not use.

        Args:
            inertia: The inertia in force [kg m²], shape (3, 3).
            raised: Whether the time constant of a contact is raised.
        """
        settings, written, root = self.settings, self.written, self._file.source
        if raised:
            constant = 2.0 * self._file.model.opt.timestep
            yield "solref", settings.get("solref", Setting("solref")), f"raised to a time constant of {constant:g} s, two time steps"
        if written is not None:
            wanted, has = np.linalg.eigvalsh(written), np.linalg.eigvalsh(inertia)
            if np.abs(wanted - has).max() > SAME * np.abs(wanted).max():
                why = [str(s) for name in CHANGED_BY if (s := option_setting(root, "compiler", name, "")).file]
                made = f"refused ({self._file.refusal}); measured with balanceinertia" if self._file.refusal else "changed"
                yield "inertia", settings["inertia"], f"{made}: moments {digits(has.tolist())} kg m²" + (f", by {why[0]}" if why else "")
        if self._file.is_urdf:
            element = self.element
            if self._file.model.body_weldid[self._head] == 0:
                yield "base", Setting("the root link") if element is None else element.words, "welded to the world"
            for tag, value in IN_FORCE.items():
                for found in [] if element is None else element.every(tag):
                    if found.number("value", value) != value:
                        yield tag, found.words, "not read"


def digits(values: Sequence[float]) -> str:
    """Numbers with three digits."""
    return ", ".join(f"{value:.3g}" for value in values)

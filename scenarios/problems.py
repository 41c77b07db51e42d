"""Numbered problems: the identifiers by which the catalogue's scenes are cited.

`DS-023` is a problem and `DS-023.1` the first version of its definition. The index `problems.toml` has the scene, the version and the
digest of the definition of each. A number is never given to another problem; a definition that changes gets the next version.
"""

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import NamedTuple

from dropspin.scenarios.errors import SceneError, did_you_mean
from dropspin.scenarios.model import Scenario

INDEX = Path(__file__).parent / "problems.toml"
UNKNOWN = "none known"
"""Stands in lists for the exact solution of a problem that has none."""
IDENTIFIER = r"(?i)(ds-[0-9]+)(\.[0-9]+)?"


class Problem(NamedTuple):
    """A numbered problem.

    Attributes:
        number: Such as `DS-023`.
        scene: The name of its scene in the catalogue.
        version: The version of its definition, from 1.
        digest: `Scenario.digest` of the definition.
        truth: The name of its exact solution, for lists, or that none is known; `truth_for` computes the impacts too, which takes half a
            second.
    """

    number: str
    scene: str
    version: int
    digest: str
    truth: str = UNKNOWN

    @property
    def identifier(self) -> str:
        """The number with the version, such as `DS-023.1`."""
        return f"{self.number}.{self.version}"


@cache
def problems() -> dict[str, Problem]:
    """The problems by number, in ascending order."""
    index = tomllib.loads(INDEX.read_text(encoding="utf-8"))
    return {number: Problem(number=number, **entry) for number, entry in sorted(index.items())}


@cache
def _identifiers() -> dict[str, str]:
    return {problem.digest: problem.identifier for problem in problems().values()}


def identifier(scene: Scenario) -> str:
    """The identifier of the problem that a scene is, by its definition; empty for other scenes, also for those of the same name."""
    return _identifiers().get(scene.digest, "")


def scene_name(text: str) -> str:
    """The scene of an identifier; any other text unchanged.

    Raises:
        SceneError: There is no such problem, or the definition has another version.
    """
    match = re.fullmatch(IDENTIFIER, text)
    if match is None:
        return text
    known = problems()
    if match[1] not in known:
        last = list(known)[-1]
        raise SceneError(f"scene {text!r}: no problem has this number.{did_you_mean(text, known)} Give one from DS-001 to {last}.")
    problem = known[match[1]]
    if match[2] and text != problem.identifier:
        raise SceneError(
            f"scene {text!r}: this version of dropspin has {problem.identifier}, another definition; CHANGELOG.md has the versions."
        )
    return problem.scene

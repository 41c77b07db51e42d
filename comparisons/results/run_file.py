"""`run.json`: the metadata of a run folder, validated on loading."""

import json
import re
from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from pydantic_core import from_json

from dropspin.comparisons.results.complete_folders import sha256
from dropspin.comparisons.results.provenance import MEASURING
from dropspin.scenarios.text import Text
from dropspin.scenarios.validation import validated

FORMAT = 6
"""Of the folder; `earlier` reads the one before, others are refused."""
FILE, TABLE = "run.json", "results.parquet"
ARRAY_FILE = re.compile(r"(trajectories|ensembles)/[A-Za-z0-9][A-Za-z0-9.=_-]*\.npz")

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Texts = dict[Text, Text]
ArrayPath = Annotated[str, Field(pattern=f"^{ARRAY_FILE.pattern}$")]


def _time(text: str) -> str:
    datetime.fromisoformat(text)
    return text


class _Table(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid")


class Case(_Table):
    """What a file of arrays is about."""

    scene: Text
    engine: Text
    dt: Positive


class _Asked(_Table):
    """What a run was asked for; `draw` and `seed` if scenes were drawn, `within` if a tolerance of the conclusion was given."""

    scenes: list[Text]
    engines: list[Text]
    dts: Annotated[list[Positive], Field(min_length=1)]
    time_limit: Positive
    quick: bool = False
    within: Positive | None = None
    draw: Annotated[int, Field(ge=1)] | None = None
    seed: Annotated[int, Field(ge=0)] | None = None


class _Provenance(_Table):
    """`Results.provenance`, as `provenance` and the running stage make it."""

    asked: _Asked
    started: Annotated[Text, AfterValidator(_time)]
    versions: dict[Text, Text | None]
    wheels: Texts
    python: Text
    platform: Text
    cpu: Text
    cores: int | None
    commit: Text | None
    code: Text
    names: Texts
    adapters: dict[Text, Text | None]
    settings: dict[Text, dict[Text, dict[str, Any]]]
    settings_digests: Texts = {}
    motions: dict[Text, dict[Text, dict[Text, Text]]] = {}
    named: list[Text] = []
    compilation: dict[Text, Positive] = {}


class RunFile(_Table):
    """The content of `run.json`.

    Attributes:
        format: `FORMAT`, or that of `earlier`.
        provenance: As in `Results`.
        engines: The engines' labels, in order.
        scenes: The keys of each scene's file, by name.
        digests: The digest of each scene.
        origins: Where each scene is from: a name of the catalogue, a path, or empty.
        trajectories: By path of the file, the scene, the engine and the time step.
        ensembles: The same.
        conclusion: The sentences with which the report begins, for readers of the file; they are not loaded.
        sha256: By path, the checksums of all files that are loaded; that of `run.json` is of its content without this entry.
    """

    format: int
    provenance: _Provenance
    engines: Annotated[list[Text], Field(min_length=1)]
    scenes: Annotated[dict[Text, dict[str, Any]], Field(min_length=1)]
    digests: Texts
    origins: Texts
    trajectories: dict[ArrayPath, Case]
    ensembles: dict[ArrayPath, Case]
    conclusion: list[Text] = []
    sha256: dict[str, str]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        asked, engines = self.provenance.asked, set(self.engines)
        paths = {*self.trajectories, *self.ensembles}
        cases = [*self.trajectories.values(), *self.ensembles.values()]
        problems = {
            "engines: one is listed twice": len(engines) < len(self.engines),
            "digests and origins must be those of the scenes": not self.digests.keys() == self.origins.keys() == self.scenes.keys(),
            "trajectories and ensembles must be of the run's scenes, engines and time steps": not all(
                one.scene in self.scenes and one.engine in engines and one.dt in asked.dts for one in cases
            ),
            "sha256 must have every file that is loaded": self.sha256.keys() != {FILE, TABLE, *paths},
            f"provenance: versions must have {', '.join(MEASURING)}": not self.provenance.versions.keys() >= {*MEASURING},
            "provenance: has engines that the run does not have": not self.provenance.names.keys() <= engines,
            "provenance: draw and seed belong together": (asked.draw is None) != (asked.seed is None),
            "provenance: draw and scenes do not agree": asked.draw is not None
            and (asked.draw > len(asked.scenes) or asked.scenes != list(self.scenes) or self.provenance.names.keys() != engines),
        }
        if found := [problem for problem, is_one in problems.items() if is_one]:
            raise ValueError(found[0])
        return self


def signed(content: Mapping[str, Any]) -> str:
    """The text of a `run.json` with this content, and with its own checksum added to `sha256`."""
    plain = from_json(json.dumps(content, default=_plain))
    return json.dumps(plain | {"sha256": plain["sha256"] | {FILE: _checksum(plain)}}, indent=1)


def parsed(text: bytes) -> Any:
    """The content of a `run.json` that is not verified.

    Raises:
        ValueError: It is not JSON, or nested too deeply.
    """
    try:
        return from_json(text)
    except ValueError as error:
        raise ValueError(f"{FILE}: {error}") from None


def verified(content: Any) -> RunFile:
    """The content of a `run.json` as a model.

    Raises:
        ValueError: Its checksum is wrong.
        DropspinError: It is not what dropspin writes.
    """
    found = validated(RunFile, FILE, content)
    rest = content | {"sha256": {path: one for path, one in content["sha256"].items() if path != FILE}}
    verify_checksum(FILE, found.sha256[FILE], _checksum(rest))
    return found


def verify_checksum(path: str, stored: str, found: str) -> None:
    """Raise `ValueError` if a file is not as it was written."""
    if stored != found:
        raise ValueError(f"{path} is damaged: its checksum is not the one in {FILE}")


def _plain(value: Any) -> Any:
    """A value that JSON lacks: a number of NumPy as a number, anything else as text."""
    return value.item() if isinstance(value, np.generic) else str(value)


def _checksum(content: Mapping[str, Any]) -> str:
    return sha256(json.dumps(content).encode())

"""Baselines: accepted results in a text file with one line for each result, and the date, the reason and the versions of each acceptance.

A result that changed by no more than its tolerance keeps its accepted value, so that the diff of two versions of the file shows only
intended changes. Each line can be read alone, so that two branches can be merged line by line.
"""

import datetime
import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import pandas as pd
import tomlkit
from pydantic import Field
from tomlkit.items import Item

from dropspin.comparisons.engines.options import engine_name
from dropspin.comparisons.judging.convergence import STUDIES
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.symmetries import kind_of
from dropspin.comparisons.regressions.attribution import ACCEPTED
from dropspin.comparisons.regressions.changes import KEY, Digests, leaves
from dropspin.comparisons.results.complete_folders import written_whole
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS
from dropspin.comparisons.results.provenance import digest
from dropspin.comparisons.results.table import OF_SYMMETRIES
from dropspin.scenarios import DropspinError
from dropspin.scenarios.errors import did_you_mean
from dropspin.scenarios.field_types import Table
from dropspin.scenarios.loading import read_toml
from dropspin.scenarios.model import current_label
from dropspin.scenarios.text import Text
from dropspin.scenarios.validation import shown, validated

FORMAT = 3
"""Format 1 grouped results under headings, from which a merge could separate them; in format 2 the list of results had another name."""
LARGEST_FILE = 50_000_000  # bytes
EXTRA_DIGITS = 3
"""Number of additional digits with which a value is written, so that its rounding error is at most 1/200 of the tolerance."""
LARGEST_RATIO = 1e17
"""Largest ratio of a value to its tolerance that adds digits: a double has no more."""
NAMES = (
    {name: (name, metric.kind) for name, metric in METRICS.items()}
    | {name: (name, "ensemble") for name in ENSEMBLE_METRICS}
    | {f"{name}_{kind}": (name, kind) for name in METRICS for kind in STUDIES}
)
"""The metric and the kind of a result by its name in the file; a symmetry has its own name."""
KEY_LENGTH = 7
"""Number of digits of the hash that identifies an acceptance."""
HEADER = (
    "Results of rigid-body engines, measured by dropspin and accepted; one line each: scene, engine, time step [s], metric.",
    "value ± tolerance, in the unit of the metric; by: the acceptance it belongs to.",
    "`dropspin check RUN --baseline FILE` compares a run with them, `dropspin accept RUN` replaces them.",
)


class Acceptance(Table):
    """The date, reason, versions and processor of an acceptance, hashes of the code of dropspin and adapters, settings of each engine.

    And the names by which adapters of the user were asked for.
    """

    date: datetime.date
    reason: Annotated[Text, Field(min_length=1)]
    versions: dict[Text, Text]
    cpu: Text | None = None
    code: Text | None = None
    adapters: dict[Text, Text] = Field(default_factory=dict)
    names: dict[Text, Text] = Field(default_factory=dict)
    settings: dict[Text, dict[Text, Text]] = Field(default_factory=dict)

    @property
    def key(self) -> str:
        """The key in the file, a hash of the content, so that two branches do not use the same key for different acceptances."""
        return digest(self.model_dump())[:KEY_LENGTH]

    def relabelled(self, labels: Mapping[str, str]) -> "Acceptance":
        """The acceptance with other labels of engines, by their labels in it."""
        names = {engine_name(old): engine_name(new) for old, new in labels.items()}
        return self.model_copy(
            update={
                "versions": {names.get(name, name): version for name, version in self.versions.items()},
                "adapters": {labels.get(label, label): code for label, code in self.adapters.items()},
                "names": {labels.get(label, label): name for label, name in self.names.items()},
                "settings": {labels.get(label, label): settings for label, settings in self.settings.items()},
            }
        )

    def stamp_of(self, engine: str) -> dict[str, Any]:
        """The provenance of the accepted run, as `attribution.attribute` needs it; files of old dropspin versions lack some of it."""
        version = self.versions.get(engine_name(engine))
        settings = {engine: {ACCEPTED: self.settings.get(engine, {}) | ({} if version is None else {"version": version})}}
        return self.model_dump() | {"python": self.versions.get("python"), "settings": settings}


class _Line(Table):
    """A result in the file."""

    value: Annotated[float, Field(allow_inf_nan=False)]
    tolerance: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    by: str
    known_failure: bool = False


class _File(Table):
    """The content of the file, except for the lines of results."""

    format: Literal[3]
    accepted: dict[str, dict[str, Any]] = Field(default_factory=dict)
    engines: dict[Text, Text] = Field(default_factory=dict)
    scenes: dict[Text, Text | dict[Text, Text]] = Field(default_factory=dict)
    motions: dict[str, dict[Text, dict[Text, dict[str, Text]]]] = Field(default_factory=dict)
    results: dict[Text, dict[Text, dict[str, dict[str, Any]]]] = Field(default_factory=dict)


COLUMNS = {**dict.fromkeys(KEY, "str"), "value": "float64", "tolerance": "float64", "unit": "str", "by": "str", "known_failure": "bool"}


def _table(lines: list[dict[str, Any]]) -> pd.DataFrame:
    return pd.DataFrame(lines, columns=list(COLUMNS)).astype(COLUMNS)


@dataclass(frozen=True, eq=False)
class Baseline:
    """Accepted results.

    Attributes:
        acceptances: The acceptances by key, each with its date, reason and versions.
        engines: By label, the name by which an engine is run, such as `my_module:MyEngine`, if it differs from the label.
        scenes: For each acceptance and scene, the hash of everything that affects the motion.
        motions: For each acceptance, scene, engine and time step, the hash of the motions from which the results were computed.
        results: The table that `comparable_results` returns, with two more columns: `by` is the key of the acceptance; if `known_failure`
            is true, a failed check of this result does not fail the run unless the result is worse than accepted.
    """

    acceptances: Mapping[str, Acceptance] = field(default_factory=dict)
    engines: Mapping[str, str] = field(default_factory=dict)
    scenes: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    motions: Mapping[str, Digests] = field(default_factory=dict)
    results: pd.DataFrame = field(default_factory=lambda: _table([]))

    def relabelled(self, labels: Mapping[str, str]) -> "Baseline":
        """The baseline with other labels of engines, by their labels in it."""

        def motions(digests: Digests) -> Digests:
            return {(scene, labels.get(engine, engine), step): one for (scene, engine, step), one in digests.items()}

        return Baseline(
            {key: one.relabelled(labels) for key, one in self.acceptances.items()},
            {labels.get(label, label): name for label, name in self.engines.items()},
            self.scenes,
            {by: motions(digests) for by, digests in self.motions.items()},
            self.results.assign(engine=self.results["engine"].replace(dict(labels))),
        )


def load_baseline(path: str | Path) -> Baseline:
    """Read a baseline.

    Args:
        path: The file that `dropspin accept` or `write_baseline` wrote.

    Returns:
        The accepted results, each with its tolerance and the date and reason of its acceptance.

    Raises:
        DropspinError: The file is not a valid baseline. The message has the place, the value given and the values allowed.
    """
    where = str(path)
    content = read_toml(Path(path), where, "baseline", LARGEST_FILE, is_merged=True)
    if content.get("format", FORMAT) != FORMAT:
        raise DropspinError(
            f"{where}: format {shown(content['format'])}, written by {_writer(content)}, cannot be read; "
            f"this version reads format {FORMAT}. Accept the results again into a new file."
        )
    written = validated(_File, where, content)
    acceptances = {key: validated(Acceptance, f"{where}: accepted.{key}", content) for key, content in written.accepted.items()}
    for_all = {name: one for name, one in written.scenes.items() if isinstance(one, str)}  # older files have no hashes by acceptance
    by_acceptance = {key: one for key, one in written.scenes.items() if not isinstance(one, str)}
    scenes = {key: for_all | by_acceptance.get(key, {}) for key in acceptances}
    for scene, of_scene in written.results.items():
        if len({*map(current_label, of_scene)}) < len(of_scene):
            raise DropspinError(f"{where}: results of {scene}: an engine is listed by two names; remove the lines of the earlier one.")
    rows = [_row(where, keys, content, scenes) for keys, content in leaves(written.results, 4)]
    motions: dict[str, dict[tuple[str, str, str], str]] = {}
    for (by, scene, engine, step), digest_of_motions in leaves(written.motions, 4):
        _verify_steps(f"{where}: motions of {scene}, {engine}", step)
        motions.setdefault(by, {})[scene, current_label(engine), step] = digest_of_motions
    engines = {current_label(label): name for label, name in written.engines.items()}
    return Baseline(acceptances, engines, scenes, motions, _table(rows))


def _row(where: str, keys: tuple[str, ...], content: Any, scenes: Mapping[str, Mapping[str, str]]) -> dict[str, Any]:
    """A result of a file as a row of a table."""
    scene, engine, steps, name = keys
    _verify_steps(f"{where}: results of {scene}, {engine}", steps)
    here = f"{where}: results of {scene}, {current_label(engine)}, {steps}: {name}"
    if name not in NAMES and kind_of(name) is None:
        raise DropspinError(f"{here}: no such result.{did_you_mean(name, NAMES)}")
    metric, kind = NAMES.get(name, (name, kind_of(name)))
    line = validated(_Line, here, content)
    if line.by not in scenes:
        raise DropspinError(f"{here}: by: got {line.by!r}; accepted are {', '.join(scenes) or 'none'}.")
    if scene not in scenes[line.by]:
        raise DropspinError(f"{where}: scenes.{line.by}: {scene!r} has results, but no hash; remove its results, and accept them again.")
    unit = "1" if kind in ("order", *OF_SYMMETRIES) else (METRICS.get(metric) or ENSEMBLE_METRICS[metric]).unit
    identity = dict(zip(KEY, (scene, current_label(engine), steps, metric, kind), strict=True))
    return identity | line.model_dump() | {"unit": unit}


def _verify_steps(where: str, steps: str) -> None:
    """Raise `DropspinError` unless a text is a time step [s], or several, as `changes.step_names` writes it."""
    try:
        written = ", ".join(repr(float(step)) for step in steps.split(","))
    except ValueError:
        raise DropspinError(f"{where}: {steps!r} is not a time step or a list of them; write seconds, such as '0.004'.") from None
    if written != steps:
        raise DropspinError(f"{where}: {steps!r}: write it as {written!r}, or runs at this step will not find it.")


def _writer(content: Mapping[str, Any]) -> str:
    """The versions of dropspin from which results of another format were accepted, if the file contains them."""
    try:
        versions = {f"dropspin {one['versions']['dropspin']}" for one in content["accepted"].values()}
    except (AttributeError, KeyError, TypeError):
        versions = set()
    return ", ".join(sorted(versions)) or "another version of dropspin"


def write_baseline(baseline: Baseline, path: str | Path) -> None:
    """Write a baseline. If this fails, an existing file stays unchanged.

    Args:
        baseline: The baseline, from `accept`.
        path: The file; its folder is created if it does not exist.

    Raises:
        DropspinError: The file cannot be written.
    """
    with written_whole(path) as unfinished:
        unfinished.write_text(_text(baseline), encoding="utf-8")


def _text(baseline: Baseline) -> str:
    """The content of the file, in an order that depends only on the content."""
    held = baseline.results.sort_values(KEY)
    engines, scenes = set(held["engine"]), {*zip(held["by"], held["scene"], strict=True)}
    lines = [*(f"# {line}" for line in HEADER), "", f"format = {FORMAT}", ""]
    for key, one in sorted(baseline.acceptances.items(), key=lambda item: (item[1].date, item[0])):
        lines.append(_assigned(["accepted", key], {name: content for name, content in one.model_dump().items() if content}))
    lines.append("")
    lines += [_assigned(["engines", name], text) for name, text in sorted(baseline.engines.items()) if name in engines]
    lines += [_assigned(["scenes", by, scene], baseline.scenes[by][scene]) for by, scene in sorted(scenes)]
    cases = {(row["by"], row["scene"], row["engine"], step) for row in held.to_dict("records") for step in row["steps"].split(", ")}
    measured = {(by, *case): digest for by, digests in baseline.motions.items() for case, digest in digests.items()}
    lines += [_assigned(["motions", *key], measured[key]) for key in sorted(cases & measured.keys())]
    for _, rows in held.groupby(["scene", "engine", "steps"], sort=False):
        lines.append("")
        for row in rows.to_dict("records"):
            name = f"{row['metric']}_{row['kind']}" if row["kind"] in STUDIES else row["metric"]
            lines.append(_assigned(["results", row["scene"], row["engine"], row["steps"], name], _line(row)))
    return "\n".join(lines) + "\n"


def _assigned(path: Sequence[str], content: Mapping[str, Any] | str) -> str:
    return f"{tomlkit.key(path).as_string()} = {_item(content).as_string()}"


def _item(content: Any) -> Item:
    """A value of a file; a mapping in one line."""
    if not isinstance(content, Mapping):
        return tomlkit.item(content)
    table = tomlkit.inline_table()
    table.update({name: _item(inner) for name, inner in content.items()})
    return table


def _line(row: Mapping[Hashable, Any]) -> dict[str, Any]:
    """What the file has of a result."""
    value, tolerance = float(row["value"]), float(f"{row['tolerance']:.2g}")
    ratio = min(max(abs(value) / tolerance, 1.0), LARGEST_RATIO)
    digits = EXTRA_DIGITS + math.ceil(math.log10(ratio))
    line = {"value": float(f"{value:.{digits}g}"), "tolerance": tolerance, "by": row["by"]}
    return line | ({"known_failure": True} if row["known_failure"] else {})

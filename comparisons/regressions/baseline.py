"""Baselines: accepted results in a text file with one line for each result, and the date, the reason and the versions of each acceptance.

A result that changed by no more than its tolerance keeps its accepted value, so that the diff of two versions of the file shows only
intended changes. Each line can be read alone, so that two branches can be merged line by line.
"""

import datetime
import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal

import pandas as pd
import tomlkit
from pydantic import Field
from tomlkit.items import InlineTable, Item

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.regressions.motions import Digests, digests_of, flat
from dropspin.comparisons.regressions.result_names import assert_steps, metric_and_kind, name_of
from dropspin.comparisons.regressions.values import KEY, asked_for, broke_down, changes, comparable_results, verify_comparable
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS
from dropspin.comparisons.results.folder import written_whole
from dropspin.comparisons.results.provenance import digest, versions_behind
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import OF_SYMMETRIES
from dropspin.scenarios import DropspinError
from dropspin.scenarios.loading import read_toml
from dropspin.scenarios.model import current_label
from dropspin.scenarios.tables import Table
from dropspin.scenarios.text import Text
from dropspin.scenarios.validation import shown, validated

FORMAT = 3
"""Format 1 grouped results under headings, from which a merge could separate them; in format 2 the list of results had another name."""
LARGEST_FILE = 50_000_000  # bytes
EXTRA_DIGITS = 3
"""Number of additional digits with which a value is written, so that its rounding error is at most 1/200 of the tolerance."""
LARGEST_RATIO = 1e17
"""Largest ratio of a value to its tolerance that adds digits: a double has no more."""
KEY_LENGTH = 7
"""Number of digits of the hash that identifies an acceptance."""
HEADER = (
    "Results of rigid-body engines, measured by dropspin and accepted; one line each: scene, engine, time step [s], metric.",
    "value ± tolerance, in the unit of the metric; by: the acceptance it belongs to.",
    "`dropspin check RUN --baseline FILE` compares a run with them, `dropspin accept RUN` replaces them.",
)


class Acceptance(Table):
    """The date, the reason and the versions of an acceptance, and the hashes of dropspin's code and of each adapter's."""

    date: datetime.date
    reason: Annotated[Text, Field(min_length=1)]
    versions: dict[Text, Text]
    code: Text | None = None
    adapters: dict[Text, Text] = Field(default_factory=dict)

    @property
    def key(self) -> str:
        """The key in the file, a hash of the content, so that two branches do not use the same key for different acceptances."""
        return digest(self.model_dump())[:KEY_LENGTH]

    def stamp_of(self, engine: str) -> dict[str, Any]:
        """What it has of the provenance of the run, for `attribution.attribute`; baselines of earlier versions have no hashes of code."""
        version = self.versions.get(engine.split("[", maxsplit=1)[0])
        settings = {engine: {"accepted": {} if version is None else {"version": version}}}
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
    scenes: dict[Text, Text] = Field(default_factory=dict)
    motions: dict[str, dict[Text, dict[Text, dict[str, Text]]]] = Field(default_factory=dict)
    results: dict[Text, dict[Text, dict[str, dict[str, Any]]]] = Field(default_factory=dict)


COLUMNS = {**dict.fromkeys(KEY, "str"), "value": "float64", "tolerance": "float64", "unit": "str", "by": "str", "known_failure": "bool"}


def _table(lines: list[dict[str, Any]]) -> pd.DataFrame:
    return pd.DataFrame(lines, columns=list(COLUMNS)).astype(COLUMNS)


@dataclass(frozen=True, eq=False)
class Baseline:
    """Accepted results.

    Attributes:
        acceptances: Acceptances by key.
        engines: The name by which an engine is run, if it differs from the label, such as `my_module:MyEngine`.
        scenes: The hash of what each scene simulates.
        motions: By the key of an acceptance: by scene, engine and time step, the hash of the motions from which its results were measured.
        results: The table that `comparable_results` returns, with two more columns: `by` is the key of the acceptance; if `known_failure`
            is true, a failed check of this result does not fail the run unless the result is worse than accepted.
    """

    acceptances: Mapping[str, Acceptance] = field(default_factory=dict)
    engines: Mapping[str, str] = field(default_factory=dict)
    scenes: Mapping[str, str] = field(default_factory=dict)
    motions: Mapping[str, Digests] = field(default_factory=dict)
    results: pd.DataFrame = field(default_factory=lambda: _table([]))


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
    content = read_toml(Path(path), where, "baseline", LARGEST_FILE)
    if content.get("format", FORMAT) != FORMAT:
        raise DropspinError(
            f"{where}: format {shown(content['format'])}, written by {_writer(content)}, cannot be read; "
            f"this version reads format {FORMAT}. Accept the results again into a new file."
        )
    written = validated(_File, where, content)
    acceptances = {key: validated(Acceptance, f"{where}: accepted.{key}", content) for key, content in written.accepted.items()}
    lines = [_read_line(where, key, content, acceptances) for key, content in _listed(where, written)]
    motions = {
        by: {(scene, current_label(engine), step): digest for (scene, engine, step), digest in flat(nested).items()}
        for by, nested in written.motions.items()
    }
    for scene, engine, step in chain.from_iterable(motions.values()):
        assert_steps(f"{where}: motions of {scene}, {engine}", step)
    engines = {current_label(label): name for label, name in written.engines.items()}
    return Baseline(acceptances, engines, written.scenes, motions, _table(lines))


def _listed(where: str, written: _File) -> Iterator[tuple[tuple[str, str, str, str], Any]]:
    """The results of a file, each with scene, engine, time steps, name and the content of the line."""
    for scene, engines in written.results.items():
        if scene not in written.scenes:
            raise DropspinError(f"{where}: scenes: {scene!r} has results, but no digest; accept them again.")
        if len({*map(current_label, engines)}) < len(engines):
            raise DropspinError(f"{where}: results of {scene}: an engine is listed by two names; remove the lines of the earlier one.")
        for engine, steps in engines.items():
            for step, named in steps.items():
                assert_steps(f"{where}: results of {scene}, {engine}", step)
                for name, content in named.items():
                    yield (scene, current_label(engine), step, name), content


def _read_line(where: str, key: tuple[str, str, str, str], content: Any, acceptances: Mapping[str, Acceptance]) -> dict[str, Any]:
    """A result of a file as a row of a table."""
    scene, engine, steps, name = key
    here = f"{where}: results of {scene}, {engine}, {steps}: {name}"
    metric, kind = metric_and_kind(here, name)
    line = validated(_Line, here, content)
    if line.by not in acceptances:
        raise DropspinError(f"{here}: by: got {line.by!r}; accepted are {', '.join(acceptances) or 'none'}.")
    unit = "1" if kind in ("order", *OF_SYMMETRIES) else (METRICS.get(metric) or ENSEMBLE_METRICS[metric]).unit
    identity = {"scene": scene, "engine": engine, "steps": steps, "metric": metric, "kind": kind}
    return identity | line.model_dump() | {"unit": unit}


def _writer(content: Mapping[str, Any]) -> str:
    """The versions of dropspin from which results of another format were accepted, if the file contains them."""
    try:
        versions = {f"dropspin {one['versions']['dropspin']}" for one in content["accepted"].values()}
    except (AttributeError, KeyError, TypeError):
        versions = set()
    return ", ".join(sorted(versions)) or "another version of dropspin"


def accept(
    results: Results, earlier: Baseline, reason: str, date: datetime.date, *, known_failures: bool = False
) -> tuple[Baseline, pd.DataFrame]:
    """Accept the results of a run into a baseline.

    Accepted results stay if the run does not cover them, if they changed by no more than their tolerance, or if the engine broke down in
    the scene or is missing. All results of a scene that has changed are replaced.

    Args:
        results: The run.
        earlier: The earlier baseline; `Baseline()` if there is none.
        reason: The reason why these results are accepted, which is stored with them.
        date: Date of the acceptance.
        known_failures: Whether to accept failing checks as known failures.

    Returns:
        The new baseline, and a table of the differences from the earlier one. The table has a row for each result, with `value` and
        `before` in `unit`, and the `change`: new, worse, moved, better, same or gone.

    Raises:
        DropspinError: The run is quick.
    """
    verify_comparable(results)
    mine = comparable_results(results)
    mine["known_failure"] = (mine["verdict"] == "failed") & known_failures
    old = asked_for(earlier.results, results)
    scenes = {name: scene.digest for name, scene in results.scenes.items()}
    same_scene = old["scene"].map(lambda name: earlier.scenes[name] == scenes[name]).astype(bool)
    found = changes(old[same_scene], mine)
    lost = (found["change"] == "gone") & broke_down(found, results)
    kept = old[same_scene].merge(found.loc[(found["change"] == "same") | lost, KEY], on=KEY)
    if known_failures:
        flags = kept[KEY].merge(mine[[*KEY, "known_failure"]], on=KEY, how="left")["known_failure"]
        kept = kept.assign(known_failure=flags.where(flags.notna(), kept["known_failure"].to_numpy()).astype(bool).to_numpy())
    stamp = results.provenance
    adapters = {engine: code for engine, code in stamp["adapters"].items() if code is not None and (mine["engine"] == engine).any()}
    acceptance = Acceptance(date=date, reason=reason, versions=versions_behind(stamp), code=stamp["code"], adapters=adapters)
    moved = mine.merge(kept[KEY], on=KEY, how="left", indicator=True)
    moved = moved[moved["_merge"] == "left_only"].assign(by=acceptance.key)
    outside = earlier.results.drop(old.index)
    outdated = outside["scene"].map(lambda name: earlier.scenes[name] != scenes.get(name, earlier.scenes[name])).astype(bool)
    everything = pd.concat([outside[~outdated], kept, moved], ignore_index=True)[list(COLUMNS)]
    used = set(everything["by"])
    acceptances = {key: one for key, one in {acceptance.key: acceptance, **earlier.acceptances}.items() if key in used}
    names = {label: name for label, name in stamp["names"].items() if name != label}
    motions = {**earlier.motions, acceptance.key: {**earlier.motions.get(acceptance.key, {}), **digests_of(stamp)}}
    return Baseline(acceptances, {**earlier.engines, **names}, {**earlier.scenes, **scenes}, motions, everything), found[~lost]


def write_baseline(baseline: Baseline, path: str | Path) -> None:
    """Write a baseline, completely or not at all.

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
    engines, scenes = set(held["engine"]), set(held["scene"])
    lines = [*(f"# {line}" for line in HEADER), "", f"format = {FORMAT}", ""]
    for key, one in sorted(baseline.acceptances.items(), key=lambda item: (item[1].date, item[0])):
        content = {"date": one.date, "reason": one.reason, "versions": _inline(one.versions)}
        content |= {"code": one.code} if one.code else {}
        content |= {"adapters": _inline(one.adapters)} if one.adapters else {}
        lines.append(_assigned(["accepted", key], _inline(content)))
    lines.append("")
    for table, named, used in (("engines", baseline.engines, engines), ("scenes", baseline.scenes, scenes)):
        lines += [_assigned([table, name], tomlkit.string(text)) for name, text in sorted(named.items()) if name in used]
    cases = {(row["by"], row["scene"], row["engine"], step) for row in held.to_dict("records") for step in row["steps"].split(", ")}
    measured = {(by, *case): digest for by, digests in baseline.motions.items() for case, digest in digests.items()}
    lines += [_assigned(["motions", *key], tomlkit.string(measured[key])) for key in sorted(cases & measured.keys())]
    for _, rows in held.groupby(["scene", "engine", "steps"], sort=False):
        lines.append("")
        for row in rows.to_dict("records"):
            lines.append(_assigned(["results", row["scene"], row["engine"], row["steps"], name_of(row)], _inline(_line(row))))
    return "\n".join(lines) + "\n"


def _assigned(path: Sequence[str], content: Item) -> str:
    return f"{tomlkit.key(path).as_string()} = {content.as_string()}"


def _inline(content: Mapping[str, Any]) -> InlineTable:
    table = tomlkit.inline_table()
    table.update(content)
    return table


def _line(row: Mapping[Hashable, Any]) -> dict[str, Any]:
    value, tolerance = float(row["value"]), float(f"{row['tolerance']:.2g}")
    ratio = min(max(abs(value) / tolerance, 1.0), LARGEST_RATIO)
    digits = EXTRA_DIGITS + math.ceil(math.log10(ratio))
    line = {"value": float(f"{value:.{digits}g}"), "tolerance": tolerance, "by": row["by"]}
    return line | ({"known_failure": True} if row["known_failure"] else {})

"""The folder of the record: a Parquet file for each engine, release and machine, whose name ends with the hash of its content.

`origin=own` has what was measured here, `origin=unsigned` what others sent: a reader of partitioned Parquet files makes a column of that.
A file is complete or absent, never changed, and whoever has it can verify it; the hash does not prove who measured it.
"""

import io
import json
import math
import platform
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from dropspin.comparisons.engines.options import calibrated_label
from dropspin.comparisons.engines.registry import BUILT_IN, parsed
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.record.environments import without_paths
from dropspin.comparisons.results.complete_folders import read_stored, sha256, written_whole
from dropspin.comparisons.results.provenance import processor
from dropspin.comparisons.results.table import schema_of, stored_table
from dropspin.scenarios import DropspinError

Row = Mapping[str, Any]
OWN, OTHERS = "origin=own", "origin=unsigned"
RELEASES = "_releases.json"
HASH = 16
NAME = re.compile(r"([a-z][a-z-]*)-(\w[\w.+!-]*)-([0-9a-f]{16})\.parquet", re.ASCII)
TEXTS = (
    *("engine", "release", "label", "profile", "scene", "scene_digest", "metric", "unit", "verdict", "reason", "trajectory"),
    *("adapter", "plan", "versions", "processor", "system", "python", "measured"),
)
NUMBERS = ("dt", "value", "low", "high", "cost", "median_cost", "relative_cost")
SCHEMA = schema_of(TEXTS, NUMBERS)
BLANK: Row = dict.fromkeys(TEXTS, "") | dict.fromkeys(NUMBERS, math.nan)
KEY = ("label", "scene", "dt", "metric")
"""The columns in which the rows of a file differ."""
SIMULATION = KEY[:3]
OF_SIMULATION = (*SIMULATION, "scene_digest", "adapter", "verdict", "reason", "trajectory", "cost", "median_cost", "relative_cost")
"""The columns that all rows of a simulation share."""
CONSTANT = ("engine", "release", "plan", "versions", "processor", "system", "python", "measured")
MACHINE = ("processor", "system", "python")
SAME = ("plan", "adapter", *MACHINE)
"""What a stored release must share with a new measurement, so that it is not measured again."""
SHA256 = re.compile("[0-9a-f]{64}|")


def machine() -> dict[str, str]:
    """The processor, system and Python of this machine, without names that somebody chose."""
    system = " ".join(filter(None, [platform.system(), platform.machine(), *platform.libc_ver()]))
    return {"processor": processor(), "system": system, "python": platform.python_version()}


class Record:
    """The folder of the record.

    Args:
        folder: The folder; it need not exist.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def write_releases(self, listed: Mapping[str, Sequence[str]]) -> None:
        """Write which releases the index had, engine by engine; those of other engines stay.

        Raises:
            DropspinError: The file is damaged.
        """
        path = self.folder / RELEASES
        try:
            known = dict(json.loads(read_stored(self.folder, RELEASES))) if path.exists() else {}
        except (ValueError, TypeError):
            raise DropspinError(f"{path}: is damaged; delete it: dropspin record writes it again.") from None
        known |= {engine: {"listed": date.today().isoformat(), "releases": list(names)} for engine, names in listed.items()}
        with written_whole(path) as unfinished:
            unfinished.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")

    def own(self, engine: str, release: str) -> Iterator[tuple[Path, list[dict[str, Any]]]]:
        """The files that were measured here of a release, and their rows."""
        for path in sorted((self.folder / OWN).glob(f"{engine}-{release}-*.parquet")):
            yield path, stored(path)[1]

    def has(self, engine: str, release: str, same: Row) -> bool:
        """Whether a release is measured, with this plan, adapter and machine; one that was not installable may be another day."""
        return any(
            all({row[name] for row in rows if row[name]} <= {same[name]} for name in SAME) and rows[0]["verdict"] != "missing"
            for _, rows in self.own(engine, release)
        )

    def write(self, engine: str, release: str, rows: Iterable[Row], common: Row) -> Path | None:
        """Write the rows of a release, in the place of earlier ones of this machine.

        None if these stay: they have results and the new rows have none, or both failed for the same reason.

        Args:
            engine: The engine.
            release: Its release.
            rows: The rows, some columns of which may be missing.
            common: Columns that are the same in all rows.
        """
        named = {"engine": engine, "release": release, "measured": date.today().isoformat()}
        whole = [{**BLANK, **common, **row, **named} for row in rows]
        for row in whole:
            row["profile"] = _profile(row["label"])
        earlier = [one for one in self.own(engine, release) if all(one[1][0][name] == whole[0][name] for name in MACHINE)]
        if not whole[0]["label"] and any(rows[0]["label"] or rows[0]["reason"] == whole[0]["reason"] for _, rows in earlier):
            return None
        content = io.BytesIO()
        pq.write_table(pa.Table.from_pylist(whole, SCHEMA), content, compression="zstd", compression_level=19, store_schema=False)
        path = self.folder / OWN / f"{engine}-{release}-{sha256(content.getvalue())[:HASH]}.parquet"
        with written_whole(path) as unfinished:
            unfinished.write_bytes(content.getvalue())
        for old, _ in earlier:
            if old != path:
                old.unlink()
        return path

    def merge(self, places: Iterable[str]) -> list[str]:
        """Add files that others sent, unless the record has them.

        Args:
            places: Files of a record, or folders that have some, at any depth.

        Returns:
            The names of the files that were added.

        Raises:
            DropspinError: A file is refused; none is added then.
        """
        sent = {path.name: stored(path)[0] for place in places for path in _files(Path(place))}
        new = sent.keys() - {path.name for path in self.folder.rglob("*.parquet")}
        for name in new:
            with written_whole(self.folder / OTHERS / name) as unfinished:
                unfinished.write_bytes(sent[name])
        return [name for name in sent if name in new]


def stored(path: Path) -> tuple[bytes, list[dict[str, Any]]]:
    """The content and the rows of a file of the record: what `Record.write` wrote, with the hash of the content in its name.

    Raises:
        DropspinError: It is not such a file, or it was changed.
    """
    named = NAME.fullmatch(path.name)
    if named is None:
        raise DropspinError(f"{path.name}: refused: its name is not ENGINE-RELEASE-HASH.parquet, as dropspin record writes it.")
    try:
        content = read_stored(path.parent, path.name)
    except (OSError, ValueError) as error:
        raise DropspinError(f"{path.name}: cannot be read: {error}.") from None
    if sha256(content)[:HASH] != named[3]:
        raise DropspinError(f"{path.name}: refused: it was changed or damaged; its content does not have the hash in its name.")
    try:
        rows = stored_table(content, SCHEMA).to_pylist()
        _verify(rows, named[1], named[2])
    except Exception as error:  # whatever pyarrow raises for a file that is none
        raise DropspinError(f"{path.name}: refused: {' '.join(str(error).split())}.") from None
    return content, rows


def _files(place: Path) -> list[Path]:
    """The Parquet files of a place."""
    found = sorted(place.rglob("*.parquet")) if place.is_dir() else [place]
    if not found or not place.exists():
        raise DropspinError(f"{place}: has no file of a record; give a folder that dropspin record wrote, or a file in it.")
    return found


def _profile(label: str) -> str:
    """The profile of an engine with its options."""
    return "" if not label else "default" if calibrated_label(label) is not None else "calibrated"


def _verify(rows: Sequence[Row], engine: str, release: str) -> None:
    """Raise an error if a file has rows that no record has."""
    keys, units = ({tuple(row[name] for name in names) for row in rows} for names in (KEY, ("metric", "unit")))
    simulations, motions = ({tuple(str(row[name]) for name in names) for row in rows} for names in (SIMULATION, OF_SIMULATION))
    texts = {row[name] for row in rows for name in TEXTS}  # of thousands of rows, a few hundred
    problems = {
        "no rows": not rows,
        "gaps": any(row[name] is None for row in rows for name in NUMBERS),
        "another engine or release than its name": {(row["engine"], row["release"]) for row in rows} != {(engine, release)},
        "rows of several machines, dates or plans": len({tuple(row[name] for name in CONSTANT) for row in rows}) > 1,
        "two rows of one result": len(keys) < len(rows),
        "two motions, verdicts or costs of one simulation": len(motions) > len(simulations),
        "an engine that dropspin does not have": engine not in BUILT_IN,
        "a metric that dropspin does not have": not {metric for metric, _ in units} <= {"", *METRICS},
        "another unit than its metric": any(unit != METRICS[metric].unit for metric, unit in units if metric in METRICS),
        "a time step that is not above 0 and finite": any(row["scene"] and not 0.0 < row["dt"] < math.inf for row in rows),
        "another profile than that of its label": any(row["profile"] != _profile(row["label"]) for row in rows),
        "a label of another engine": any(parsed(label)[0] != engine for label in {row["label"] for row in rows} - {""}),
        "a trajectory that is no SHA-256": not all(SHA256.fullmatch(row["trajectory"]) for row in rows),
        "a path": any(without_paths(text) != text for text in texts),
    }
    if found := [problem for problem, is_one in problems.items() if is_one]:
        raise ValueError(f"it has {found[0]}")
    date.fromisoformat(rows[0]["measured"])

"""A run as a folder: `run.json`, `results.parquet`, `trajectories/*.npz`, `ensembles/*.npz`."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import pandas as pd

from comparisons.results.ensembles import EnsembleOutcome
from comparisons.results.measurement import COLUMNS
from comparisons.results.results import Results, TrajectoryKey
from scenarios import DropspinError, Trajectory, load

ARRAYS = ("t", "position", "orientation", "velocity", "angular_velocity", "velocity_lag")
FORMAT = 4
"""Of the folder; 1 had no tolerances, 2 no time limit, 3 tolerances in a file of their own."""
PROVENANCE_KEYS = {
    "asked",
    "started",
    "versions",
    "wheels",
    "python",
    "platform",
    "cpu",
    "cores",
    "commit",
    "code",
    "names",
    "adapters",
    "settings",
}
ASKED_KEYS = {"scenes", "engines", "dts", "time_limit"}
"""What a run's provenance must have, and its part about what the run was asked for."""
OUTCOME = tuple(field.name for field in fields(EnsembleOutcome))


def save(results: Results, folder: Path) -> None:
    """Write a run's data into a folder that exists."""
    trajectories = _save_arrays(folder, "trajectories", results.trajectories, ARRAYS)
    ensembles = _save_arrays(folder, "ensembles", results.ensembles, OUTCOME)
    scenes = {name: scene.model_dump(mode="json", exclude={"name"}, exclude_defaults=True) for name, scene in results.scenes.items()}
    digests = {name: scene.digest for name, scene in results.scenes.items()}
    content = {
        "format": FORMAT,
        "provenance": results.provenance,
        "engines": results.engines,
        "scenes": scenes,
        "digests": digests,
        "origins": {name: scene.origin for name, scene in results.scenes.items()},
        "trajectories": trajectories,
        "ensembles": ensembles,
    }
    (folder / "run.json").write_text(json.dumps(content, indent=1, default=str), encoding="utf-8")
    rows = pd.concat([results.table, results.predictions, results.agreements])
    rows.to_parquet(folder / "results.parquet", index=False)


def load_results(folder: str | Path, *, arrays: bool = True) -> Results:
    """Load a run from its folder.

    Args:
        folder: The folder that `dropspin run -o` or `write_report` wrote.
        arrays: Whether to load trajectories and ensembles too; the tables alone load much faster.

    Returns:
        The run, equal to the one that was written.

    Raises:
        DropspinError: The folder holds no run, or one of another format.
    """
    try:
        return _loaded(Path(folder), arrays)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, BadZipFile) as error:
        detail = " ".join(f"{type(error).__name__}: {error}".split())
        raise DropspinError(f"{folder}: not the folder of a run, or damaged ({detail}); give one that dropspin run -o wrote.") from None


def _loaded(folder: Path, arrays: bool) -> Results:
    content = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise DropspinError(f"{folder}: has a format of {_writer(content)}, which this version cannot read; run it again.")
    rows = pd.read_parquet(folder / "results.parquet")[list(COLUMNS)].astype(COLUMNS)
    lacking = PROVENANCE_KEYS - content["provenance"].keys() | ASKED_KEYS - content["provenance"]["asked"].keys()
    if lacking:
        raise ValueError(f"its provenance lacks {', '.join(sorted(lacking))}")
    if not set(rows["scene"]) <= content["scenes"].keys():
        raise ValueError("its table has scenes that run.json does not have")
    files = {kind: content[kind] if arrays else {} for kind in ("trajectories", "ensembles")}
    trajectories = {
        key: Trajectory(**found | {"velocity_lag": float(found["velocity_lag"])})
        for key, found in _loaded_arrays(folder, files["trajectories"], ARRAYS)
    }
    ensembles = {key: EnsembleOutcome(**found) for key, found in _loaded_arrays(folder, files["ensembles"], OUTCOME)}
    scenes = {
        name: load({"name": name, **scene}).model_copy(update={"origin": content["origins"][name]})
        for name, scene in content["scenes"].items()
    }
    is_prediction, is_agreement = (rows["kind"] == kind for kind in ("prediction", "agreement"))
    table, *others = (rows[kept].reset_index(drop=True) for kept in (~(is_prediction | is_agreement), is_prediction, is_agreement))
    return Results(table, scenes, tuple(content["engines"]), trajectories, ensembles, content["provenance"], *others)


def _writer(content: Any) -> str:
    """Which version of dropspin wrote a folder, as far as its run.json says."""
    try:
        return f"dropspin {content['provenance']['versions']['dropspin']}"
    except (KeyError, TypeError):
        return "another version of dropspin"


def _save_arrays(folder: Path, kind: str, items: Mapping[TrajectoryKey, Any], names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Write one file per item; the result maps each path to its scene, engine and time step."""
    (folder / kind).mkdir()
    files = {}
    for number, ((scene, engine, dt), item) in enumerate(items.items()):
        path = f"{kind}/{number:03d}-{_file_name(scene)}-{_file_name(engine)}-{dt:g}.npz"
        np.savez_compressed(folder / path, allow_pickle=False, **{name: getattr(item, name) for name in names})
        files[path] = {"scene": scene, "engine": engine, "dt": dt}
    return files


def _loaded_arrays(folder: Path, files: Mapping[str, Mapping[str, Any]], names: Sequence[str]) -> Iterator[tuple[TrajectoryKey, Any]]:
    for path, key in files.items():
        with np.load(folder / path, allow_pickle=False) as arrays:
            yield (key["scene"], key["engine"], key["dt"]), {name: arrays[name] for name in names}


def _file_name(text: str) -> str:
    """A name that any file system accepts."""
    return re.sub(r"[^A-Za-z0-9.=]+", "-", text).strip("-")[:60]

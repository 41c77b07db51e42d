"""A run as a folder: `run.json`, `results.parquet`, `tolerances.parquet` (row by row), `trajectories/*.npz`, `ensembles/*.npz`."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import pandas as pd

from comparisons.ensembles import Outcome
from comparisons.results import COLUMNS, Results, TrajectoryKey
from scenarios import DropspinError, Trajectory, load

ARRAYS = ("t", "position", "orientation", "velocity", "angular_velocity", "velocity_lag")
FORMAT = 3
"""Of the folder; 1 had no tolerances, 2 no time limit."""
STAMPED = {
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
ASKED = {"scenes", "engines", "dts", "time_limit"}
"""What a run's provenance tells, and what of it the run was asked for."""
OUTCOME = tuple(field.name for field in fields(Outcome))


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
    results.frame.to_parquet(folder / "results.parquet", index=False)
    pd.DataFrame({"tolerance": results.tolerances}).to_parquet(folder / "tolerances.parquet", index=False)


def restore(folder: Path, *, arrays: bool = True) -> Results:
    """Read a run's data back.

    Args:
        folder: Of the run.
        arrays: Whether trajectories and ensembles are wanted too; figures alone are read much faster.

    Raises:
        DropspinError: The folder holds no run, or one of another version.
    """
    try:
        return _restored(folder, arrays)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, BadZipFile) as error:
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise DropspinError(f"{folder}: not the folder of a run, or damaged ({said}); give one that dropspin run -o wrote.") from None


def _restored(folder: Path, arrays: bool) -> Results:
    content = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise DropspinError(f"{folder}: is a run of another version of dropspin, which this one cannot read; run it again.")
    frame = pd.read_parquet(folder / "results.parquet").astype(COLUMNS)
    tolerances = pd.read_parquet(folder / "tolerances.parquet")["tolerance"].to_numpy()
    lacking = STAMPED - content["provenance"].keys() | ASKED - content["provenance"]["asked"].keys()
    if lacking:
        raise ValueError(f"its provenance lacks {', '.join(sorted(lacking))}")
    if len(frame) != len(tolerances) or not set(frame["scene"]) <= content["scenes"].keys():
        raise ValueError("its tables are not of one run")
    files = {kind: content[kind] if arrays else {} for kind in ("trajectories", "ensembles")}
    trajectories = {
        key: Trajectory(**found | {"velocity_lag": float(found["velocity_lag"])})
        for key, found in _restored_arrays(folder, files["trajectories"], ARRAYS)
    }
    ensembles = {key: Outcome(**found) for key, found in _restored_arrays(folder, files["ensembles"], OUTCOME)}
    scenes = {
        name: load({"name": name, **scene}).model_copy(update={"origin": content["origins"][name]})
        for name, scene in content["scenes"].items()
    }
    return Results(frame, scenes, tuple(content["engines"]), trajectories, ensembles, content["provenance"], tolerances)


def _save_arrays(folder: Path, kind: str, items: Mapping[TrajectoryKey, Any], names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """One file an item; the files' paths, and which scene, engine and step each is of."""
    (folder / kind).mkdir()
    files = {}
    for number, ((scene, engine, dt), item) in enumerate(items.items()):
        path = f"{kind}/{number:03d}-{_file_name(scene)}-{_file_name(engine)}-{dt:g}.npz"
        np.savez_compressed(
            folder / path, allow_pickle=False, **{name: getattr(item, name) for name in names if getattr(item, name) is not None}
        )
        files[path] = {"scene": scene, "engine": engine, "dt": dt}
    return files


def _restored_arrays(folder: Path, files: Mapping[str, Mapping[str, Any]], names: Sequence[str]) -> Iterator[tuple[TrajectoryKey, Any]]:
    for path, key in files.items():
        with np.load(folder / path, allow_pickle=False) as arrays:
            yield (key["scene"], key["engine"], key["dt"]), {name: arrays[name] for name in names if name in arrays}


def _file_name(text: str) -> str:
    """A name that any file system takes."""
    return re.sub(r"[^A-Za-z0-9.=]+", "-", text).strip("-")[:60]

"""A run as a folder: `run.json`, `results.parquet`, `trajectories/*.npz`."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd

from comparisons.results import COLUMNS, Results, TrajectoryKey
from scenarios import DropspinError, Trajectory, load

ARRAYS = ("t", "position", "orientation", "velocity", "angular_velocity", "velocity_lag")


def save(results: Results, folder: Path) -> None:
    """Write a run's data into a folder that exists."""
    (folder / "trajectories").mkdir()
    files = {}
    for number, (key, motion) in enumerate(results.trajectories.items()):
        scene, engine, dt = key
        path = f"trajectories/{number:03d}-{_file_name(scene)}-{_file_name(engine)}-{dt:g}.npz"
        np.savez_compressed(folder / path, allow_pickle=False, **{name: getattr(motion, name) for name in ARRAYS})
        files[path] = {"scene": scene, "engine": engine, "dt": dt}
    scenes = {name: scene.model_dump(mode="json", exclude={"name"}, exclude_defaults=True) for name, scene in results.scenes.items()}
    digests = {name: scene.digest for name, scene in results.scenes.items()}
    content = {
        "provenance": results.provenance,
        "engines": results.engines,
        "scenes": scenes,
        "digests": digests,
        "trajectories": files,
    }
    (folder / "run.json").write_text(json.dumps(content, indent=1, default=str), encoding="utf-8")
    results.frame.to_parquet(folder / "results.parquet", index=False)


def restore(folder: Path) -> Results:
    """Read a run's data back.

    Raises:
        DropspinError: The folder holds no run.
    """
    try:
        content = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        frame = pd.read_parquet(folder / "results.parquet").astype(COLUMNS)
    except (OSError, json.JSONDecodeError) as error:
        raise DropspinError(f"{folder}: not the folder of a run ({error}); give the folder that dropspin run -o wrote.") from None
    trajectories: dict[TrajectoryKey, Trajectory] = {}
    for path, key in content["trajectories"].items():
        with np.load(folder / path, allow_pickle=False) as arrays:
            motion = {name: arrays[name] for name in ARRAYS}
        motion["velocity_lag"] = float(motion["velocity_lag"])
        trajectories[key["scene"], key["engine"], key["dt"]] = Trajectory(**motion)
    scenes = {name: load({"name": name, **scene}) for name, scene in content["scenes"].items()}
    return Results(frame, scenes, tuple(content["engines"]), trajectories, content["provenance"])


def _file_name(text: str) -> str:
    """A name that any file system takes."""
    return re.sub(r"[^A-Za-z0-9.=]+", "-", text).strip("-")[:60]

"""A run as a folder: `run.json`, `results.parquet`, `trajectories/*.npz`, `ensembles/*.npz`.

A folder may be damaged, or somebody else's: all of it is verified on loading, and nothing in it is executed.
"""

import io
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from dropspin.comparisons.results import older_formats
from dropspin.comparisons.results.complete_folders import file_name, read_stored, sha256
from dropspin.comparisons.results.ensembles import QUICK_MEMBERS, SAMPLES, EnsembleOutcome
from dropspin.comparisons.results.results import Results, TrajectoryKey
from dropspin.comparisons.results.run_file import FILE, FORMAT, TABLE, Case, RunFile, parsed, signed, verified, verify_checksum
from dropspin.comparisons.results.table import results_table
from dropspin.scenarios import DropspinError, Scenario, SceneError, Trajectory
from dropspin.scenarios.loading import from_mapping
from dropspin.scenarios.rotations import length
from dropspin.scenarios.state import Array

FEWEST_ROWS = 2
"""Of a trajectory: metrics take the time step from them."""
SAME_TIME = 1e-6
"""Largest relative difference of a stored time from its multiple of the time step."""
SAME_LENGTH = 1e-4
"""Largest difference of a stored quaternion's length from 1."""
LARGEST_HEADER = 1000  # bytes, of an array in a file
Kept = TypeVar("Kept")


def save(results: Results, folder: Path, conclusion: Sequence[str] = (), *, compress: bool = True) -> None:
    """Write a run's data into a folder that exists; compressing its arrays takes six times as long as writing them."""
    checksums: dict[str, str] = {}
    trajectories = _save_arrays(folder, "trajectories", results.trajectories, checksums, compress)
    ensembles = _save_arrays(folder, "ensembles", results.ensembles, checksums, compress)
    pd.concat([results.table, results.predictions, results.agreements]).to_parquet(folder / TABLE, index=False)
    checksums[TABLE] = sha256((folder / TABLE).read_bytes())
    content = {
        "format": FORMAT,
        "provenance": results.provenance,
        "engines": results.engines,
        "scenes": {name: scene.model_dump(mode="json", exclude={"name"}, exclude_defaults=True) for name, scene in results.scenes.items()},
        "digests": {name: scene.digest for name, scene in results.scenes.items()},
        "origins": {name: scene.origin for name, scene in results.scenes.items()},
        "trajectories": trajectories,
        "ensembles": ensembles,
        "conclusion": list(conclusion),
        "sha256": checksums,
    }
    (folder / FILE).write_text(signed(content), encoding="utf-8")


def load_results(folder: str | Path, *, arrays: bool = True) -> Results:
    """Load a run from its folder.

    Args:
        folder: The folder that `dropspin run -o` or `write_report` wrote.
        arrays: Whether to load also the trajectories and ensembles; the tables alone load much faster.

    Returns:
        The run, equal to the one that was written.

    Raises:
        DropspinError: The folder does not contain a run, or the run is damaged or has another format.
    """
    try:
        content = parsed(read_stored(Path(folder), FILE))
        if isinstance(content, dict) and content.get("format") in (FORMAT, older_formats.FORMAT):
            file = verified(content)
            if file.format == older_formats.FORMAT:
                content = older_formats.with_current_labels(content)
                file = RunFile.model_validate(content)
            return _loaded(Path(folder), file, content["provenance"], arrays)
    except (OSError, ValueError, DropspinError) as error:
        detail = " ".join((f"{error.filename}: {error.strerror}" if isinstance(error, OSError) and error.strerror else str(error)).split())
        raise DropspinError(
            f"{folder}: not the folder of a run, or damaged ({detail.removesuffix('.')}); give one that dropspin run -o wrote."
        ) from None
    raise DropspinError(f"{folder}: has a format of {_writer(content)}, which this version cannot read; run it again.")


def _loaded(folder: Path, file: RunFile, provenance: Mapping[str, Any], arrays: bool) -> Results:
    scenes = {name: _scene(file, name) for name in file.scenes}
    is_earlier = file.format == older_formats.FORMAT
    read_table = partial(results_table, scenes=scenes, engines=file.engines, dts=file.provenance.asked.dts, is_earlier=is_earlier)
    rows = _from_file(folder, TABLE, file, read_table)
    read_outcome = partial(_outcome, most=QUICK_MEMBERS if file.provenance.asked.quick else None)
    trajectories = _arrays(folder, file, file.trajectories if arrays else {}, scenes, _trajectory)
    ensembles = _arrays(folder, file, file.ensembles if arrays else {}, scenes, read_outcome)
    is_prediction, is_agreement = (rows["kind"] == kind for kind in ("prediction", "agreement"))
    table, *others = (rows[kept].reset_index(drop=True) for kept in (~(is_prediction | is_agreement), is_prediction, is_agreement))
    return Results(table, scenes, tuple(file.engines), trajectories, ensembles, provenance, *others)


def _scene(file: RunFile, name: str) -> Scenario:
    try:
        scene = from_mapping({**file.scenes[name], "name": name}).model_copy(update={"origin": file.origins[name]})
    except SceneError as error:
        raise ValueError(f"{FILE}: {error}") from None
    if scene.digest != file.digests[name]:
        raise ValueError(f"{FILE}: the scene {name!r} is not the one that was run")
    return scene


def _arrays(
    folder: Path, file: RunFile, files: Mapping[str, Case], scenes: Mapping[str, Scenario], read: Callable[..., Kept]
) -> dict[TrajectoryKey, Kept]:
    return {
        (case.scene, case.engine, case.dt): _from_file(folder, path, file, partial(read, scene=scenes[case.scene], dt=case.dt))
        for path, case in files.items()
    }


def _trajectory(content: bytes, scene: Scenario, dt: float) -> Trajectory:
    rows = scene.steps(dt) + 1
    vectors = dict.fromkeys(("position", "velocity", "angular_velocity"), (rows, 3))
    found = _loaded_arrays(content, {"t": (rows,), **vectors, "orientation": (rows, 4), "velocity_lag": ()})
    velocity_lag = float(found.pop("velocity_lag"))
    if rows < FEWEST_ROWS or not np.allclose(found["t"], dt * np.arange(rows), rtol=SAME_TIME, atol=0.0) or not np.isfinite(velocity_lag):
        raise ValueError("its times are not those of its time steps")
    is_finite = all(np.isfinite(found[name]).all() for name in ("orientation", *vectors))  # what a diverged engine returns is kept
    if is_finite and not np.allclose(length(found["orientation"]), 1.0, rtol=0.0, atol=SAME_LENGTH):
        raise ValueError("its orientations are not unit quaternions")
    return Trajectory(**found, velocity_lag=velocity_lag)


def _outcome(content: bytes, scene: Scenario, dt: float, most: int | None) -> EnsembleOutcome:
    if scene.ensemble is None:
        raise ValueError("its scene has no ensemble")
    size = min(scene.ensemble.size, most or scene.ensemble.size)
    shapes = {"t": (SAMPLES,), "energy": (size, SAMPLES), "rebound": (size,), "rest_time": (size,), "angular_momentum": (size, SAMPLES)}
    return EnsembleOutcome(**_loaded_arrays(content, shapes))


def _from_file(folder: Path, path: str, file: RunFile, read: Callable[[bytes], Kept]) -> Kept:
    """What a file holds, if its checksum is right.

    Raises:
        ValueError: The file is damaged, or no such file; the text names it.
    """
    content = read_stored(folder, path)
    verify_checksum(path, file.sha256[path], sha256(content))
    try:
        return read(content)
    except Exception as error:  # whatever the parsers of NumPy, zlib and pyarrow raise for a file that is none
        raise ValueError(f"{path}: {error}") from None


def _writer(content: Any) -> str:
    """Which version of dropspin wrote a folder, as far as its run.json says."""
    with suppress(KeyError, TypeError):
        return f"dropspin {str(content['provenance']['versions']['dropspin'])[:20]}"
    return "another version of dropspin"


def _save_arrays(
    folder: Path, kind: str, items: Mapping[TrajectoryKey, Any], checksums: dict[str, str], compress: bool
) -> dict[str, dict[str, Any]]:
    """Write one file per item and add its checksum; the result maps each path to its scene, engine and time step."""
    (folder / kind).mkdir()
    files = {}
    for number, ((scene, engine, dt), item) in enumerate(items.items()):
        path = f"{kind}/{number:03d}-{file_name(scene)}-{file_name(engine)}-{dt:g}.npz"
        content = io.BytesIO()
        arrays = {field.name: np.asarray(getattr(item, field.name), dtype=np.float64) for field in fields(item)}
        (np.savez_compressed if compress else np.savez)(content, allow_pickle=False, **arrays)
        (folder / path).write_bytes(content.getvalue())
        checksums[path] = sha256(content.getvalue())
        files[path] = {"scene": scene, "engine": engine, "dt": dt}
    return files


def _loaded_arrays(content: bytes, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Array]:
    """The arrays in a .npz file, by name.

    Raises:
        ValueError: It has other arrays, types or shapes, or is damaged.
    """
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        sizes = {member.filename: member.file_size for member in archive.zip.infolist()}
        if sorted(archive.zip.namelist()) != sorted(f"{name}.npy" for name in shapes):
            raise ValueError(f"has other arrays than {', '.join(shapes)}")
        for name, shape in shapes.items():  # before they are read, which takes as much memory as their sizes
            if sizes[f"{name}.npy"] > 8 * math.prod(shape) + LARGEST_HEADER:
                raise ValueError(f"{name}: has more numbers than its shape {shape}")
        found = {name: archive[name] for name in shapes}
    for name, array in found.items():
        if array.dtype != np.dtype("<f8") or array.shape != shapes[name]:
            raise ValueError(f"{name}: has type {array.dtype} and shape {array.shape}; must have float64 and {shapes[name]}")
    return found

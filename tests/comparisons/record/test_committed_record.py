"""The record in the repository: its files are as they were written, and show the known changes of MuJoCo's integrators."""

import re
from pathlib import Path

import pandas as pd
import pytest

from dropspin.comparisons.record.store import HASH, stored
from dropspin.comparisons.results.complete_folders import sha256

RECORD = Path(__file__).parents[3] / "record"


def numbers(release):
    return tuple(map(int, re.findall(r"\d+", release)))


def test_no_file_was_changed():
    paths = sorted(RECORD.rglob("*.parquet"))
    assert len({path.name.rpartition("-")[0] for path in paths}) >= 40
    assert all(path.stem.endswith(f"-{sha256(path.read_bytes())[:HASH]}") for path in paths)
    assert all(stored(path)[1] for path in paths[::20])


@pytest.mark.parametrize(
    ("integrator", "metric", "expected"),
    [
        ("euler", "energy_error", []),
        ("implicit", "energy_error", ["3.7.0", "3.8.1"]),
        ("implicitfast", "energy_error", ["3.7.0", "3.11.0"]),
        ("rk4", "orientation_error", ["4.0.0"]),
    ],
)
def test_releases_in_which_free_rotation_changed(integrator, metric, expected):
    """As measured by MuJoCo's Python package alone; see comparisons/engines/mujoco_engine.py."""
    label = "mujoco" if integrator == "euler" else f"mujoco[integrator={integrator}]"
    filters = [("label", "==", label), ("scene", "==", "spin-asymmetric"), ("metric", "==", metric), ("dt", "==", 4e-3)]
    values = pd.read_parquet(RECORD, columns=["release", "value"], filters=filters).set_index("release")["value"]
    values = values.loc[sorted(values.index, key=numbers)]
    changes = (values.diff().abs() > 1e-6 * values.abs() + 1e-9).pipe(lambda moved: moved[moved])
    assert list(changes.index) == expected

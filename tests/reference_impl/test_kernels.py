"""One source, two ways to run it; and a cache on disk that never serves old physics."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import reference_impl

PACKAGE = Path(reference_impl.__file__).parent

# Every leaf once, and ten pairs.
CHOICES = [
    {},
    *({"rotation": name} for name in ("gyroscopic", "implicit-gyroscopic", "midpoint", "rk4", "symmetric-top", "exact")),
    *({"law": name} for name in ("normal", "poisson", "clamped", "coulomb")),
    {"law": "normal", "contact": "sequential"},
    {"correction": "projection"},
    {"rotation": "rk4", "law": "normal"},
    {"rotation": "exact", "law": "poisson"},
    {"rotation": "midpoint", "law": "coulomb"},
    {"rotation": "symmetric-top", "law": "clamped"},
    {"rotation": "gyroscopic", "correction": "projection"},
    {"rotation": "rk4", "law": "coulomb", "contact": "sequential"},
    {"rotation": "exact", "law": "normal", "contact": "sequential", "correction": "projection"},
    {"rotation": "implicit-gyroscopic", "law": "poisson", "correction": "projection"},
    {"law": "clamped", "correction": "projection"},
    {"rotation": "midpoint", "law": "normal", "contact": "sequential"},
]
TUMBLE = """
import json, sys
import numpy as np
import reference_impl as r
half = np.array([.1, .2, .3])
points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
body = r.Body(1.0, r.solid_box_inertia(1.0, half), points)
start = np.array([0, .45, 0, .1, .2, .3, .9, .4, -1, .2, 3, 2, 1])
start[3:7] /= np.linalg.norm(start[3:7])
for choice in json.loads(sys.argv[1]):
    friction = .4 if choice.get("law") == "coulomb" else np.inf
    world = r.World(np.array([0, -9.8, 0]), r.Floor(.5, friction, .01), (.1, .2))
    rows = r.simulate(start, body, world, 1e-3, 400, methods=r.Methods(**choice))
    print(rows.tobytes().hex())
"""


def test_interpreted_and_compiled_agree_to_the_last_bit():
    """Every method through contacts, in plain Python and compiled."""
    import json

    outputs = [
        subprocess.run(
            [sys.executable, "-c", TUMBLE, json.dumps(CHOICES)],
            env=os.environ | {"NUMBA_DISABLE_JIT": disabled},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for disabled in ("0", "1")
    ]
    assert len(outputs[0]) == len(CHOICES)
    for choice, compiled, interpreted in zip(CHOICES, *outputs, strict=True):
        assert compiled == interpreted, choice
    assert len(set(outputs[0][:7])) == 7  # and no two rotations are the same


FALL = """
import numba, sys
before = numba.config.CACHE_DIR
import numpy as np
import reference_impl as r
body = r.Body(1.0, np.eye(3), np.zeros((1, 3)), 0.1)
rows = r.simulate(np.array([0, 9, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.]), body, r.World(np.array([0, -1, 0])), 1.0, 1)
from reference_impl.kernels import recording_kernel
from reference_impl import Methods
print(rows[-1, 8], sum(recording_kernel(Methods(), False).stats.cache_hits.values()), numba.config.CACHE_DIR == before)
"""


def fall(folder, **environment):
    done = subprocess.run(
        [sys.executable, "-c", FALL], cwd=folder, env=os.environ | environment, capture_output=True, text=True, check=True
    )
    return done.stdout.split()


def test_an_edited_source_is_never_served_old(tmp_path):
    """A second process takes the kernel from disk; after an edit in a file that the kernel only imports, it is compiled anew."""
    shutil.copytree(PACKAGE, tmp_path / "reference_impl", ignore=shutil.ignore_patterns("__pycache__"))
    assert fall(tmp_path) == ["-1.0", "0", "True"]
    assert fall(tmp_path) == ["-1.0", "1", "True"]
    step = tmp_path / "reference_impl" / "step.py"
    step.write_text(step.read_text().replace("v = v + dt * gravity", "v = v + (2.0 * dt) * gravity"))
    assert fall(tmp_path) == ["-2.0", "0", "True"]
    assert fall(tmp_path) == ["-2.0", "1", "True"]


def test_settings_of_numba_are_part_of_the_key(tmp_path):
    """Kernels compiled under other settings are not taken; the user's own cache folder is used and left set."""
    shutil.copytree(PACKAGE, tmp_path / "reference_impl", ignore=shutil.ignore_patterns("__pycache__"))
    own = {"NUMBA_CACHE_DIR": str(tmp_path / "own")}
    assert fall(tmp_path, **own) == ["-1.0", "0", "True"]
    assert list((tmp_path / "own").glob("dropspin-*"))
    assert fall(tmp_path, NUMBA_OPT="1", **own) == ["-1.0", "0", "True"]
    assert fall(tmp_path, **own) == ["-1.0", "1", "True"]


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path):
    """A folder that cannot be made costs the cache, not the run."""
    shutil.copytree(PACKAGE, tmp_path / "reference_impl", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "a-file").write_text("")
    assert fall(tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "a-file")) == ["-1.0", "0", "True"]

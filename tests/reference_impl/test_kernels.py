"""One source, two ways to run it; and a cache on disk that never serves old physics."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

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

rng = np.random.default_rng(1)
KINDS, BODIES = 5, 19  # 19 bodies of 5 kinds: more than fill the lanes, and not a multiple of their number
half = rng.uniform(.1, .3, (KINDS, 3))
mass = rng.uniform(.5, 2, KINDS)
inertia = np.array([r.solid_box_inertia(m, h) for m, h in zip(mass, half)])
points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half[:, None]
starts = np.zeros((KINDS, 13))
starts[:, 1] = rng.uniform(.4, .5, KINDS)
starts[:, 3:] = rng.normal(size=(KINDS, 10))
starts[:, 3:7] /= np.linalg.norm(starts[:, 3:7], axis=1)[:, None]
gravity = np.array([0, -9.8, 0]) + rng.normal(size=(KINDS, 3))
dt, restitution, linear, angular = rng.uniform([8e-4, .3, .1, .2], [2e-3, .9, .3, .4], (KINDS, 4)).T
rest_speed = np.array([0, .01, 0, .02, .3])

def given(which, law):
    friction = np.array([.1, np.inf, 0, .4, .8]) if law == "coulomb" else np.array([np.inf, 0, np.inf, np.inf, 0])
    floor = r.Floor(restitution[which], friction[which], rest_speed[which])
    world = r.World(gravity[which], floor, (linear[which], angular[which]))
    return starts[which], r.Body(mass[which], inertia[which], points[which], .01), world, dt[which]

for choice in json.loads(sys.argv[1]):
    methods, law = r.Methods(**choice), choice.get("law")
    if sys.argv[2] == "alone":
        rows = np.array([r.simulate(*given(kind, law), 300, methods=methods) for kind in range(KINDS)])
    else:
        rows = r.simulate(*given(np.arange(BODIES) % KINDS, law), 300, methods=methods, threads=int(sys.argv[3]))
        assert all(np.array_equal(rows[body], rows[body % KINDS]) for body in range(BODIES)), choice
    print(rows[:KINDS].tobytes().hex())
"""


@pytest.mark.parametrize("choices", [CHOICES[first::6] for first in range(6)])
def test_alone_interpreted_compiled_and_in_an_ensemble_agree_to_the_last_bit(choices):
    """Every method through contacts; of bodies, worlds and step sizes that all differ."""
    outputs = [
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", TUMBLE, json.dumps(choices), *how],
            env=os.environ | {"NUMBA_DISABLE_JIT": disabled},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for disabled, *how in (("1", "alone"), ("0", "alone"), ("0", "ensemble", "1"), ("0", "ensemble", "2"))
    ]
    for choice, interpreted, *others in zip(choices, *outputs, strict=True):
        assert others == [interpreted] * 3, choice
    assert len(set(outputs[0])) == len(choices)  # and no two choices are the same


def test_an_ensemble_has_the_same_bits_on_a_plain_processor():
    """Without AVX there are fewer lanes; the physics is none the wiser."""
    outputs = [
        subprocess.run(
            [sys.executable, "-c", TUMBLE, "[{}]", "ensemble", "1"], env=os.environ | target, capture_output=True, text=True, check=True
        ).stdout
        for target in ({}, {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""})
    ]
    assert outputs[0] == outputs[1]


FALL = """
import numba, sys
before = numba.config.CACHE_DIR
import numpy as np
import reference_impl as r
body = r.Body(1.0, np.eye(3), np.zeros((1, 3)), 0.1)
rows = r.simulate(np.array([0, 9, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.]), body, r.World(np.array([0, -1, 0])), 1.0, 1)
from reference_impl.kernels import Parts, recording_kernel
kernel = recording_kernel(r.Methods(), Parts(gravity=True, forces=False, damping=False, floor=False, turning=False), 1)
print(rows[-1, 8], sum(kernel.stats.cache_hits.values()), numba.config.CACHE_DIR == before)
"""


def fall(folder, program=FALL, **environment):
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=folder, env=os.environ | environment, capture_output=True, text=True, check=True
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
    law = tmp_path / "reference_impl" / "laws" / "note.py"
    law.write_text(law.read_text() + "# in a folder of the package\n")
    assert fall(tmp_path) == ["-2.0", "0", "True"]


def test_an_edit_after_the_import_is_not_filed_under_the_new_text(tmp_path):
    """Old code, imported before an edit, must not serve the processes that import the edited source."""
    shutil.copytree(PACKAGE, tmp_path / "reference_impl", ignore=shutil.ignore_patterns("__pycache__"))
    program = FALL.replace("body = r.Body", "edit()\nbody = r.Body").replace(
        "import numba, sys",
        "import numba, sys, pathlib\n"
        "def edit():\n"
        "    step = pathlib.Path(r.__file__).parent / 'step.py'\n"
        "    step.write_text(step.read_text().replace('v = v + dt * gravity', 'v = v + (2.0 * dt) * gravity'))\n",
    )
    assert fall(tmp_path, program)[0] == "-1.0"
    assert fall(tmp_path)[:2] == ["-2.0", "0"]


def test_the_users_cache_setting_survives_first_use_in_many_threads():
    """Kernels declared at once by several threads leave numba's setting as it was."""
    program = (
        "import sys, numba\nsys.setswitchinterval(1e-6)\nfrom concurrent.futures import ThreadPoolExecutor\n"
        "from reference_impl.kernels import Parts, recording_kernel\nfrom reference_impl import Methods\nbefore = numba.config.CACHE_DIR\n"
        "parts = Parts(True, False, False, True, True)\n"
        "with ThreadPoolExecutor(8) as pool:\n"
        "    list(pool.map(lambda law: recording_kernel(Methods(law=law), parts, 1), ['note', 'normal', 'poisson', 'coulomb'] * 8))\n"
        "print(numba.config.CACHE_DIR == before)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True"]


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

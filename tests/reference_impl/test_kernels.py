"""Kernels have the same bits interpreted, compiled, in ensembles and in threads; and the cache on disk never serves stale kernels."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from support.methods import COVERING, FURTHER

from dropspin import reference_impl
from dropspin.reference_impl import Body, Floor, Methods, World
from dropspin.reference_impl.floor_plane import BLOCK
from dropspin.reference_impl.kernels import recording_kernel
from dropspin.reference_impl.methods import CONTACTS, LAWS, ROTATIONS
from dropspin.reference_impl.state import ORIENTATION

PACKAGE = Path(reference_impl.__file__).parent
KINDS, BODIES = 5, 19
ALL = np.arange(BODIES) % KINDS
STEPS = 100


def tumbling(which, law):
    """The arguments of `simulate` for some of the kinds: bodies that touch the floor, worlds and time steps that all differ."""
    rng = np.random.default_rng(1)
    half = rng.uniform(0.1, 0.3, (KINDS, 3))
    mass = rng.uniform(0.5, 2, KINDS)
    inertia = np.array([reference_impl.solid_box_inertia(m, h) for m, h in zip(mass, half, strict=True)])
    points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half[:, None]
    starts = np.zeros((KINDS, 13))
    starts[:, 1] = rng.uniform(0.4, 0.5, KINDS)
    starts[:, 3:] = rng.normal(size=(KINDS, 10))
    starts[:, ORIENTATION] /= np.linalg.norm(starts[:, ORIENTATION], axis=1)[:, None]
    gravity = np.array([0, -9.8, 0]) + rng.normal(size=(KINDS, 3))
    dt, restitution, linear, angular = rng.uniform([2.4e-3, 0.3, 0.1, 0.2], [6e-3, 0.9, 0.3, 0.4], (KINDS, 4)).T
    rest_speed = np.array([0, 0.01, 0, 0.02, 0.3])
    friction = np.array([0.1, np.inf, 0, 0.4, 0.8]) if law == "coulomb" else np.array([np.inf, 0, np.inf, np.inf, 0])
    floor = Floor(restitution[which], friction[which], rest_speed[which])
    world = World(gravity[which], floor, (linear[which], angular[which]))
    return starts[which], Body(mass[which], inertia[which], points[which], (0.01, 0.01, 0.01)), world, dt[which]


def alone(choice):
    law, methods = choice.get("law"), Methods(**choice)
    return np.array([reference_impl.simulate(*tumbling(kind, law), STEPS, methods=methods) for kind in range(KINDS)])


def test_covering_choices_contain_every_leaf():
    chosen = [Methods(**choice) for choice in COVERING]
    assert {methods.rotation for methods in chosen} == set(ROTATIONS)
    assert {methods.law for methods in chosen} == set(LAWS)
    assert {methods.contact for methods in chosen} == set(CONTACTS)


@pytest.fixture
def interpreted(monkeypatch):
    """A function that calls another one with the kernels as plain Python, as under NUMBA_DISABLE_JIT=1."""

    def call(function, *arguments):
        with monkeypatch.context() as patched:
            patched.setattr(numba.config, "DISABLE_JIT", 1)
            patched.setattr(sys.modules["dropspin.reference_impl.simulate"], "recording_kernel", recording_kernel.__wrapped__)
            return function(*arguments)

    return call


@pytest.mark.parametrize("choices", [COVERING, pytest.param(FURTHER, marks=pytest.mark.slow)], ids=["covering", "further"])
@pytest.mark.filterwarnings("ignore:the contact was not solved")
def test_interpreted_compiled_and_ensemble_results_agree_to_the_last_bit(choices, interpreted):
    """Through contacts, for bodies, worlds and time steps that all differ."""
    results = set()
    for choice in choices:
        expected = interpreted(alone, choice)
        np.testing.assert_array_equal(alone(choice), expected, err_msg=f"{choice}, one body")
        for threads in (1, 2):
            arguments = tumbling(ALL, choice.get("law"))
            rows = reference_impl.simulate(*arguments, STEPS, methods=Methods(**choice), threads=threads)
            np.testing.assert_array_equal(rows, expected[ALL], err_msg=f"{choice}, ensemble in {threads} threads")
        results.add(expected.tobytes())
    assert len(results) == len(choices)  # no two choices are the same method


@pytest.mark.extended
def test_vertices_in_blocks_collide_as_one_after_the_other(monkeypatch):
    """With many vertices, in no order, to the last bit."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(3 * BLOCK + 7, 3))
    points *= np.array([0.1, 0.2, 0.3]) / np.linalg.norm(points, axis=1)[:, None]
    body = Body(1.0, reference_impl.vertex_inertia(points, np.full(len(points), 1 / len(points))), points)
    world = World(np.array([0, -9.8, 0]), Floor(0.5, np.inf))
    starts = np.tile(np.array([0, 0.4, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.0]), (20, 1))
    starts[:, 7:] = rng.normal(size=(20, 6)) * [2, 1, 0.3, 5, 5, 5]
    together = reference_impl.simulate(starts, body, world, 5e-3, 300)
    monkeypatch.setattr(sys.modules["dropspin.reference_impl.simulate"], "BLOCK", len(points) + 1)
    turned = np.diff(together[:, :, 10:], axis=1).any(axis=2)
    assert turned.sum() > 400  # steps with an impulse
    for start, expected in zip(starts, together, strict=True):
        np.testing.assert_array_equal(reference_impl.simulate(start, body, world, 5e-3, 300), expected)


def test_one_body_and_ensembles_are_one_kernel_in_the_cache():
    """All arrays have one memory layout: otherwise a kernel would be stored once for each, under the same name."""
    starts = np.asfortranarray(np.tile([0, 9, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.0], (3, 1)))
    world = World(np.array([0, -1, 0]))
    for states, dt in ((starts[0], 0.1), (starts, 0.1), (starts, np.array([0.1, 0.2, 0.3]))):
        reference_impl.simulate(states, Body(1.0, np.eye(3), np.zeros((1, 3)), (0.1, 0.1, 0.1)), world, dt, 1)
    kernel = recording_kernel(Methods(), reference_impl.kernels.Parts(True, False, False, False, False))
    assert len(kernel.args[0].signatures) == 1


def in_a_process(program, **environment):
    """What a program prints in a process with its own settings of numba."""
    program = f"import sys\nsys.path.insert(0, {str(Path(__file__).parent)!r})\n{program}"
    done = subprocess.run([sys.executable, "-c", program], env=os.environ | environment, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_kernels_are_interpreted_if_the_user_disables_jit(interpreted):
    """The documented way to a debugger: NUMBA_DISABLE_JIT=1 gives the same bits."""
    program = (
        "import test_kernels as t\nprint(t.alone({}).tobytes().hex())\n"
        "parts = t.reference_impl.kernels.Parts(True, False, True, True, True)\n"
        "print(type(t.recording_kernel(t.Methods(), parts).args[0]).__name__)"
    )
    result, kind = in_a_process(program, NUMBA_DISABLE_JIT="1", PYTHONPATH=str(Path(__file__).parents[1])).split()
    assert kind == "function"
    assert result == alone({}).tobytes().hex()


SERVER = """
import json, os, sys
import numba
import numpy
numba.njit(lambda x: x + 1.0)(1.0)  # loads the compiler, which takes longer than the kernel of a fall
for line in sys.stdin:
    folder, program, environment = json.loads(line)
    if os.fork() == 0:
        try:
            os.chdir(folder)
            sys.path.insert(0, folder)
            os.environ.update(environment)
            numba.config.reload_config()
            exec(program, {})
            sys.stdout.flush()
        finally:
            os._exit(0)
    os.wait()
    print("end", flush=True)
"""
FALL = """
import numba, sys
before = numba.config.CACHE_DIR
import numpy as np
import dropspin.reference_impl as r
body = r.Body(1.0, np.eye(3), np.zeros((1, 3)), (0.1, 0.1, 0.1))
rows = r.simulate(np.array([0, 9, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.]), body, r.World(np.array([0, -1, 0])), 1.0, 1)
from dropspin.reference_impl.kernels import Parts, recording_kernel
kernel = recording_kernel(r.Methods(), Parts(gravity=True, forces=False, damping=False, floor=False, turning=False))
print(rows[-1, 8], sum(kernel.args[0].stats.cache_hits.values()), numba.config.CACHE_DIR == before)
"""

SHORT_FALL = """
import numba
before = numba.config.CACHE_DIR
from dropspin.reference_impl import fall, kernels
kernel = kernels.compile_cached(fall.after)
print(kernel(1.0), sum(kernel.args[0].stats.cache_hits.values()), numba.config.CACHE_DIR == before)
"""
"""As `FALL`, by a kernel of its own, which takes a tenth of the time to compile."""


@pytest.fixture(scope="module")
def fall():
    """Simulate a fall with the package of a folder, in a process that has numba but not yet the package.

    Gives the velocity after a step of 1 s, the kernels taken from the cache, and whether numba's own setting is unchanged.
    """
    with subprocess.Popen([sys.executable, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:

        def run(folder, program=FALL, **environment):
            server.stdin.write(json.dumps([str(folder), program, environment]) + "\n")
            server.stdin.flush()
            found = list(iter(lambda: server.stdout.readline().strip(), "end"))
            return found[0].split() if found else []

        yield run
        server.stdin.close()


@pytest.fixture
def package(tmp_path):
    """A folder with a copy of the package and no cache."""
    shutil.copytree(PACKAGE, tmp_path / "dropspin" / "reference_impl", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "dropspin" / "__init__.py").touch()
    return tmp_path


@pytest.fixture
def short(package):
    """The folder with a kernel for `SHORT_FALL`, which calls a function of another file."""
    copy = package / "dropspin" / "reference_impl"
    (copy / "fall.py").write_text("from dropspin.reference_impl.laws.pull import pull\n\ndef after(t):\n    return pull(t)\n")
    (copy / "laws" / "pull.py").write_text("import numba\n\n@numba.njit\ndef pull(t):\n    return -t\n")
    return package


def test_edited_source_is_compiled_anew(package, fall):
    """A second process takes the kernel from the cache; an edit in a file that the kernel only imports makes it stale."""
    assert fall(package) == ["-1.0", "0", "True"]
    assert fall(package) == ["-1.0", "1", "True"]
    step = package / "dropspin" / "reference_impl" / "step.py"
    step.write_text(step.read_text().replace("v = v + dt * gravity", "v = v + (2.0 * dt) * gravity"))
    assert fall(package) == ["-2.0", "0", "True"]


def test_source_edited_after_the_import_is_compiled_anew(short, fall):
    """Kernels of code that was imported before an edit are not served to processes that import the edited source."""
    program = SHORT_FALL.replace(
        "kernel =",
        "import pathlib\n"
        "pull = pathlib.Path(fall.__file__).parent / 'laws' / 'pull.py'\n"
        "pull.write_text(pull.read_text().replace('-t', '-2.0 * t'))\n"
        "kernel =",
    )
    assert fall(short, program)[0] == "-1.0"
    assert fall(short, SHORT_FALL)[:2] == ["-2.0", "0"]


@pytest.mark.extended
def test_kernels_compiled_at_the_same_time_are_not_stored_as_each_other(package, fall):
    """Two processes read the index before either wrote it; the one that wrote its entry last writes its kernel first."""
    program = (
        "import numpy as np, numba.core.caching\nimport dropspin.reference_impl as r\n"
        "from dropspin.reference_impl.kernels import recording_kernel\n"
        "body = r.Body(1.0, np.diag([1.0, 2.0, 3.0]), np.zeros((1, 3)))\n"
        "start = np.array([0, 9, 0, 0, 0, 0, 1, 0, 0, 0, 1, 2, 3.])\n"
        "def spin(rotation):\n"
        "    return r.simulate(start, body, r.World(), 0.5, 1, methods=r.Methods(rotation=rotation))[-1, 10]\n"
    )
    both_at_once = (
        "cache, late = numba.core.caching.IndexDataCacheFile, []\n"
        "cache._load_index, save = lambda self: {}, cache._save_data\n"
        "cache._save_data = lambda *arguments: late.insert(0, arguments)\n"
        "print(spin('note'), spin('exact'))\n"
        "for arguments in late: save(*arguments)\n"
    )
    known = fall(package, program + both_at_once)
    assert known[0] == "1.0" != known[1]
    assert fall(package, program + "print(spin('note'), spin('exact'))") == known


@pytest.mark.extended
def test_user_s_cache_setting_survives_first_use_in_many_threads():
    """Kernels declared at once by several threads leave numba's setting unchanged."""
    program = (
        "import sys, numba\nsys.setswitchinterval(1e-6)\nfrom concurrent.futures import ThreadPoolExecutor\n"
        "from dropspin.reference_impl.kernels import Parts, recording_kernel\n"
        "from dropspin.reference_impl import Methods\nbefore = numba.config.CACHE_DIR\n"
        "parts = Parts(True, False, False, True, True)\n"
        "with ThreadPoolExecutor(8) as pool:\n"
        "    list(pool.map(lambda law: recording_kernel(Methods(law=law), parts), ['note', 'normal', 'poisson', 'coulomb'] * 8))\n"
        "print(numba.config.CACHE_DIR == before)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True"]


@pytest.mark.extended
def test_kernels_of_other_numba_settings_are_compiled_anew(short, fall):
    """The cache is in the user's own folder; kernels compiled under other settings are not used."""
    own = {"NUMBA_CACHE_DIR": str(short / "own")}
    assert fall(short, SHORT_FALL, **own) == ["-1.0", "0", "True"]
    assert list((short / "own").glob("dropspin-*"))
    assert fall(short, SHORT_FALL, NUMBA_OPT="1", **own) == ["-1.0", "0", "True"]
    assert fall(short, SHORT_FALL, **own) == ["-1.0", "1", "True"]


@pytest.mark.extended
def test_unwritable_cache_is_no_error(short, fall):
    (short / "a-file").write_text("")
    assert fall(short, SHORT_FALL, NUMBA_CACHE_DIR=str(short / "a-file")) == ["-1.0", "0", "True"]


@pytest.mark.extended
def test_full_disk_is_no_error(short, fall):
    """The index has room, and the kernel has not; all modules are imported before."""
    full = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))\n"
    assert fall(short, FALL.replace("body = r.Body", f"{full}body = r.Body")) == ["-1.0", "0", "True"]
    for program in (SHORT_FALL.replace("kernel =", f"{full}kernel ="), SHORT_FALL):
        assert fall(short, program) == ["-1.0", "0", "True"]

"""Scene files, and specs of sweeps: changed ones of the catalogue, and generated ones."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzz.campaign import cases
from fuzz.cases import run, surroundings
from fuzz.inputs import BALL, BALL_FILE, CATALOGUE_FILES, ENSEMBLE, RANDOM, SPEC, SPEC_FILE, toml
from fuzz.strategies import KEYS, LEAVES, NUMBERS, VALUES, damaged, edited, mostly

FILES = st.one_of(
    st.sampled_from(sorted(CATALOGUE_FILES)).flatmap(lambda name: damaged(CATALOGUE_FILES[name])),
    st.sampled_from(sorted(CATALOGUE_FILES)).flatmap(lambda name: edited(tomllib.loads(CATALOGUE_FILES[name].decode()))).map(toml),
    edited(BALL | ENSEMBLE).map(toml),
    st.dictionaries(KEYS, VALUES, max_size=5).map(toml),
    st.binary(max_size=40),
)
NEAR_SOUND = mostly(st.floats(1e-3, 10.0), NUMBERS)
VECTORS = st.lists(st.one_of(st.just(0.0), NEAR_SOUND), min_size=3, max_size=3)
BODIES = st.one_of(
    st.fixed_dictionaries({"shape": st.just("sphere"), "mass": NEAR_SOUND, "radius": NEAR_SOUND}, optional={"inertia": VECTORS}),
    st.fixed_dictionaries({"shape": st.just("box"), "mass": NEAR_SOUND, "half_extents": st.lists(NEAR_SOUND, min_size=3, max_size=3)}),
    st.fixed_dictionaries({"shape": st.just("vertices"), "mass": NEAR_SOUND, "points": st.lists(VECTORS, min_size=3, max_size=6)}),
)
WELL_TYPED = st.fixed_dictionaries(
    {"duration": mostly(st.just(0.2), NUMBERS), "body": BODIES},
    optional={
        "start": st.fixed_dictionaries({"position": VECTORS}, optional={"velocity": VECTORS, "angular_velocity": VECTORS}),
        "gravity": st.fixed_dictionaries({"acceleration": VECTORS}),
        "floor": st.fixed_dictionaries(
            {"restitution": st.floats(0.0, 1.0), "friction": NEAR_SOUND | st.sampled_from(["none", "infinite"])},
            optional={"rest_speed": NEAR_SOUND},
        ),
        "damping": st.fixed_dictionaries({}, optional={"linear": NEAR_SOUND, "angular": NEAR_SOUND}),
        "ensemble": st.fixed_dictionaries({"size": st.integers(2, 20), "seed": st.integers(0, 9)}, optional={"turn": NEAR_SOUND}),
    },
).map(toml)
NAMES = st.sampled_from(["scene.toml", "a[b].toml", "[red].toml", "x" * 200 + ".toml", "é 日.toml", "-x.toml", "drop-ball.toml", "scene"])


@cases(200)
@given(FILES | WELL_TYPED, NAMES, st.booleans())
def test_scenes_are_shown_or_refused(content, name, as_json):
    with surroundings() as work:
        (work / name).write_bytes(content)
        run(work, "show", *(["--json"] if as_json else []), "--", name, outputs=[])


@pytest.mark.extended
@cases(150)
@given(edited(BALL | ENSEMBLE).map(toml) | WELL_TYPED, NAMES, st.sampled_from(["wang", "mujoco", "pybullet"]))
def test_scenes_are_run_or_refused(content, name, engine):
    with surroundings() as work:
        (work / name).write_bytes(content)
        run(work, "run", "-e", engine, "--dt", "0.02", "--time-limit", "1", "-o", "out", "--", name, outputs=["out"])


@cases(50)
@given(
    edited(BALL | ENSEMBLE).map(toml) | WELL_TYPED,
    st.sampled_from([("limits", "--axis", "spin", "--time-limit", "5"), ("tradeoff", "--budget", "0.1")]),
)
def test_scenes_are_studied_or_refused(content, command):
    with surroundings() as work:
        (work / "scene.toml").write_bytes(content)
        run(work, *command, "-e", "wang", "-o", "out", "scene.toml", outputs=["out"])


@cases(120)
@given(
    edited(SPEC).map(toml) | edited(RANDOM).map(toml) | damaged(SPEC_FILE.encode()) | st.dictionaries(KEYS, LEAVES, max_size=3).map(toml)
)
def test_specs_of_sweeps_are_run_or_refused(content):
    with surroundings() as work:
        (work / "ball.toml").write_text(BALL_FILE)
        (work / "spec.toml").write_bytes(content)
        run(work, "sweep", "spec.toml", "--time-limit", "1", "-o", "out", outputs=["out"])

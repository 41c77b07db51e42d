"""Names of engines with options, such as `wang[contact=sequential,rotation=exact]`, and of classes, such as `my_module:MyEngine`."""

from hypothesis import given
from hypothesis import strategies as st

from dropspin.comparisons.engines.registry import BUILT_IN, engine
from fuzz.campaign import cases
from fuzz.cases import run, surroundings
from fuzz.inputs import ADAPTER, BALL_FILE, DRIFT_FILE, SPEC, toml
from fuzz.strategies import NUMBERS, TEXTS

WITH_OPTIONS = ("wang", "mujoco", "pybullet")
SOUND = st.sampled_from(WITH_OPTIONS).flatmap(
    lambda name: st.tuples(
        st.just(name),
        st.lists(
            st.one_of(
                st.sampled_from([f"{option}={value}" for option, values in engine(name).choices.items() for value in values]),
                st.sampled_from([*engine(name).numbers, "kappa"]).flatmap(lambda option: NUMBERS.map(lambda value: f"{option}={value}")),
            ),
            max_size=4,
            unique_by=lambda item: item.partition("=")[0],
        ),
    )
)
ODD = st.tuples(
    st.sampled_from(
        [*BUILT_IN, "Mujoco", "my_module:Mine", "my_module:Other", "my_module:", ":Mine", "my_module:Mine:x", "os:path", "os:system"]
    )
    | st.sampled_from(["..my_module:Mine", "my_module.Mine", "absent:Mine", "spec:Mine", "my_module:Mine.name", "my_module:np.array"])
    | TEXTS,
    st.lists(
        st.tuples(
            st.sampled_from(["method", "tolerance", "rotation", "contact", "integrator", "kappa"]) | TEXTS, TEXTS | NUMBERS.map(str)
        ).map("=".join)
        | TEXTS,
        max_size=3,
    ),
)
ENGINES = st.one_of(SOUND, SOUND, ODD, ODD).map(lambda given: f"{given[0]}[{','.join(given[1])}]" if given[1] else given[0]) | TEXTS
COMMANDS = st.sampled_from(
    [
        ("show", "ball.toml"),
        ("show", "drift.toml", "--json"),
        ("run", "ball.toml", "--dt", "0.02", "--time-limit", "1", "-o", "out"),
        ("run", "drift.toml", "--dt", "0.05", "--time-limit", "1", "-o", "out", "--json"),
    ]
)


@cases(150)
@given(ENGINES, COMMANDS)
def test_engines_are_found_or_refused(name, command):
    with surroundings() as work:
        (work / "ball.toml").write_text(BALL_FILE)
        (work / "drift.toml").write_text(DRIFT_FILE)
        (work / "my_module.py").write_text(ADAPTER)
        run(work, *command, f"--engine={name}", outputs=["out"])


@cases(80)
@given(st.lists(ENGINES, min_size=1, max_size=3))
def test_engines_of_a_sweep_are_found_or_refused(names):
    with surroundings() as work:
        (work / "ball.toml").write_text(BALL_FILE)
        (work / "my_module.py").write_text(ADAPTER)
        (work / "spec.toml").write_bytes(toml(SPEC | {"engines": names}))
        run(work, "sweep", "spec.toml", "--time-limit", "1", "-o", "out", outputs=["out"])

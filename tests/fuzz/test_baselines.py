"""Baselines: changed ones of a run, and others."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzz.campaign import cases
from fuzz.cases import fill, run, surroundings
from fuzz.inputs import toml
from fuzz.strategies import KEYS, VALUES, damaged, edited

COMMANDS = st.sampled_from(
    [
        ("check", "run", "--baseline", "dropspin-baseline.toml", "--junit", "out/junit.xml", "--summary", "out/summary.md"),
        ("check", "run", "--baseline", "dropspin-baseline.toml", "--json"),
        ("accept", "run", "--reason", "again"),
        ("accept", "run", "--reason", "again", "--known-failures", "--json"),
    ]
)


@pytest.mark.extended
@cases(200)
@given(st.data(), COMMANDS)
def test_baselines_are_used_or_refused(sound, data, command):
    content = (sound / "dropspin-baseline.toml").read_bytes()
    tree = tomllib.loads(content.decode())
    given_content = data.draw(
        edited(tree).map(toml) | damaged(content) | st.dictionaries(KEYS, VALUES, max_size=4).map(toml), label="baseline"
    )
    with surroundings() as work:
        fill(work, sound)
        (work / "dropspin-baseline.toml").write_bytes(given_content)
        run(work, *command, outputs=["out"] if command[0] == "check" else ["dropspin-baseline.toml"])


@cases(20)
@given(st.data())
def test_a_run_is_judged_by_a_baseline_or_refused(sound, data):
    content = (sound / "dropspin-baseline.toml").read_bytes()
    given_content = data.draw(edited(tomllib.loads(content.decode())).map(toml) | damaged(content), label="baseline")
    with surroundings() as work:
        fill(work, sound)
        (work / "baseline.toml").write_bytes(given_content)
        run(work, "run", "ball.toml", "-e", "wang", "--dt", "0.02", "-o", "out", "--baseline", "baseline.toml", outputs=["out"])

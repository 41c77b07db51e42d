"""Command lines: every command with any of its options, and values that no user means."""

import os

import click
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropspin.reports.commands.main import COMMANDS, dropspin
from fuzz.campaign import cases
from fuzz.cases import fill, run, run_alone, surroundings
from fuzz.strategies import NUMBERS, TEXTS

SOUND = {
    "engine_name": ["mujoco", "wang", "mujoco[integrator=rk4]"],
    "engine_names": ["mujoco", "wang", "mujoco[integrator=rk4]"],
    "engines": ["mujoco", "wang"],
    "scene": ["ball.toml", "spin-principal", "draw-1-001"],
    "scenes": ["ball.toml", "drift.toml"],
    "run": ["run", "run2", "sweep", "study"],
    "runs": ["run", "run2", "."],
    "old": ["run"],
    "new": ["run2"],
    "spec": ["spec.toml"],
    "dt": ["0.02", "0.01"],
    "dts": ["0.02", "0.01"],
    "baseline": ["dropspin-baseline.toml", "new.toml"],
    "reason": ["because"],
    "restitution": ["0.5"],
    "studies": ["study"],
    "language": ["python", "mjcf"],
    "gif": ["x.gif"],
    "speed": ["1"],
    "metric": ["energy_error"],
    "axes": ["step", "spin"],
    "checks": ["protocol"],
    "name": ["my_engine", "toy"],
    "names": ["housner-block", "drake-free-body", "nesc-brick"],
    "seed": ["1"],
    "count": ["1"],
    "output": ["out", "out/deeper", "run", "out/../out", "./out/"],
}
"""Values that the parameters of commands take, by the names in their functions."""
PATHS = st.sampled_from(
    ["run", "ball.toml", "spec.toml", "absent", ".", "..", "/", "/dev/null", "/dev/full", "/proc/x", "run/run.json", "ball.toml/x", "pipe"]
)
ODD = st.one_of(TEXTS, TEXTS, NUMBERS.map(str), PATHS)
LIMITS = {"resources": ["1", "0.5", "1e8"], "budget": ["0.1", "0.05", "1e8"]}
"""Values of options with which a command ends soon."""
ALWAYS = {"run": ["--time-limit", "1"], "sweep": ["--time-limit", "1"], "limits": ["--time-limit", "1", "--axis", "step"]}
ALWAYS |= {"tradeoff": ["--budget", "0.1"], "conform": ["--time-limit", "1"], "replay": ["--no-open"], "record": ["--merge=run"]}
"""Options without which a command takes minutes, opens a browser or uses the network."""
SLOW_WITHOUT = ("run", "limits", "tradeoff", "reproduce", "bugs")
"""Commands that take long without an argument."""
WRITTEN = ("--output", "--baseline", "--junit", "--summary", "--gif")


def command(name: str) -> click.Command:
    """The command of a name."""
    found = dropspin.get_command(click.Context(dropspin), name)
    assert found is not None
    return found


@st.composite
def values(draw: st.DrawFn, parameter: click.Parameter) -> str:
    """A value of a parameter, sound in half of the cases."""
    assert parameter.name is not None
    if parameter.name in LIMITS:
        return draw(st.sampled_from([*LIMITS[parameter.name], "0", "-1", "nan", "inf", "1e300", "x", ""]))
    known = [*parameter.type.choices] if isinstance(parameter.type, click.Choice) else SOUND.get(parameter.name, [])
    return draw(st.one_of(st.sampled_from(known), ODD) if known else ODD)


@st.composite
def command_lines(draw: st.DrawFn) -> tuple[str, ...]:
    """A command with some of its options and arguments."""
    name = draw(st.sampled_from(list(COMMANDS)))
    options: list[str] = list(ALWAYS.get(name, []))
    arguments: list[str] = []
    for parameter in command(name).params:
        if isinstance(parameter, click.Argument):
            count = draw(st.integers(1, 2) if name in SLOW_WITHOUT else st.sampled_from([1, 1, 1, 1, 2, 0]))
            arguments += [draw(values(parameter)) for _ in range(count)]
            continue
        if draw(st.sampled_from([True, False, False])) or parameter.required:
            option = parameter.opts[-1]
            options += [option] if parameter.is_flag else [f"{option}={draw(values(parameter))}"]
    if draw(st.sampled_from([False] * 9 + [True])):
        options.append(draw(st.sampled_from(["--unknown", "-h", "--version", "-", "--output", "-e", "-vvv", "--json=1"])))
    return *name.split(), *options, *(["--"] if draw(st.booleans()) else []), *arguments


def outputs(line: tuple[str, ...]) -> list[str]:
    """The paths that a command line may write."""
    named = [part.partition("=")[2] for part in line if part.startswith(WRITTEN)]
    written = ["out", *(one for one in named if one not in ("", ".", "..", "/"))]
    if line[0] == "new-adapter":
        written += [os.path.join(folder, f"{start}{name}.py") for folder in (*named, ".") for name in line[1:] for start in ("", "test_")]
    return written + {"accept": ["dropspin-baseline.toml"], "report": list(line[1:]), "replay": list(line[1:])}.get(line[0], [])


@pytest.mark.extended
@cases(300)
@given(command_lines())
def test_command_lines_are_done_or_refused(sound, line):
    with surroundings() as work:
        fill(work, sound)
        run(work, *line, outputs=outputs(line))


RAW = st.lists(ODD, min_size=1, max_size=4).filter(lambda line: line[0] not in COMMANDS).map(tuple)


@pytest.mark.extended
@cases(100)
@given((command_lines() | RAW).filter(lambda line: "\0" not in "".join(line)))  # which no process can be given
def test_command_lines_in_a_process_of_their_own_are_done_or_refused(sound, line):
    with surroundings() as work:
        fill(work, sound)
        run_alone(work, *line, outputs=outputs(line))

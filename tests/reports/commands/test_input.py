"""Input that no user means, of every kind a command takes: one message, exit code 2, nothing written."""

import os

import pytest
from support.cli import dropspin, forked

import dropspin as ds

BALL = """
duration = 0.1
[body]
shape = "sphere"
radius = 0.1
mass = 1.0
[start]
velocity = [1.0, 0.0, 0.0]
"""
SPEC = 'scenes = ["ball.toml"]\nengines = ["wang"]\ndts = [0.01]\n[grid]\n'
DIGITS = "9" * 5000
FILES = {
    "ball.toml": BALL,
    "digits.toml": BALL.replace("1.0\n[start]", f"{DIGITS}\n[start]"),
    "deep.toml": f"{BALL}\n[gravity]\n{'.'.join('a' * 3000)} = 1\n",
    "nested.toml": f"x = {'[' * 3000}{']' * 3000}\n{BALL}",
    "colour.toml": f'summary = "red \\u001b[31m"\n{BALL}',
    "turned.toml": f'summary = "turned \\u202e"\n{BALL}',
    "digits-spec.toml": f'{SPEC}"body.mass" = [{DIGITS}]\n',
    "deep-spec.toml": f"{SPEC}{'.'.join('a' * 3000)} = [1.0]\n",
    "bracket.toml": f'"a[b" = 1\n{BALL}',
    "member.toml": f"constrained-x = 1\n{BALL}",
    "long.toml": f"{'x' * 5000} = 1\n{BALL}",
    "not.toml": "{",
}
RUN = ("run", "ball.toml", "-e", "wang", "--dt", "0.01")
TOO_LARGE = "has a whole number that exceeds the range of floating-point numbers."
NOT_A_FILE = "is a pipe or a device; a"
CASES = [
    (("run", "digits.toml"), TOO_LARGE),
    (("show", "digits.toml"), TOO_LARGE),
    (("sweep", "digits-spec.toml"), TOO_LARGE),
    (("run", "deep.toml"), "nested too deeply"),
    (("run", "nested.toml"), "nested too deeply"),
    (("sweep", "deep-spec.toml"), "nested too deeply"),
    (("show", "long.toml"), "xxx ... xxx"),
    (("show", "colour.toml"), r"summary: got 'red \x1b[31m'; must be one line of printable text"),
    (("run", "turned.toml"), r"summary: got 'turned \u202e'; must be one line of printable text"),
    (("show", "bell\a.toml"), r"the argument 'bell\x07.toml' is not printable text"),
    (("run", "pipe"), NOT_A_FILE),
    (("sweep", "pipe"), NOT_A_FILE),
    (("tradeoff", "pipe"), NOT_A_FILE),
    (("limits", "pipe"), NOT_A_FILE),
    (("run", "/dev/zero"), NOT_A_FILE),
    ((*RUN, "-o", "/"), "cannot be replaced; choose a folder inside it."),
    (("tradeoff", "ball.toml", "-e", "wang", "-o", ""), "-o: got an empty name; give the name of a folder."),
    ((*RUN, "-o", ""), "cannot be replaced; choose a folder inside it."),
    ((*RUN, "-o", os.fsdecode(b"\xff\xfe")), r"the argument '\udcff\udcfe' is not printable text"),
    ((*RUN, "-o", "x" * 5000), "is not printable text of at most 4096 characters"),
    ((*RUN, "-o", "x" * 300), "File name too long"),
    ((*RUN, "-o", "/proc/x"), "cannot be written"),
    ((*RUN, "-o", "ball.toml"), "is a file; choose a folder."),
    ((*RUN, "--time-limit", "1e300"), "is not in the range"),
    ((*RUN, "--time-limit", "nan"), "nan is not"),
    ((*RUN, "--time-limit", "1e-300"), "1e-300 is not in the range"),
    ((*RUN, "--dt", "nan"), "a step must be at least"),
    (("limits", "ball.toml", "-e", "wang", "--within", "nan"), "within"),
    (("limits", "ball.toml", "-e", "wang", "--within", "inf"), "within"),
    (("tradeoff", "ball.toml", "-e", "wang", "--budget", "nan"), "nan is not"),
    (("tradeoff", "ball.toml", "-e", "wang", "--within", "nan"), "nan is not a finite number"),
    (("tradeoff", "ball.toml", "-e", "wang", "--within", "inf"), "inf is not a finite number"),
    (("replay", "out", "--speed", "inf"), "inf is not a finite number"),
    (("calibrate", "--restitution", "0.5", "--dt", "0.002", "--friction", "1e30"), "friction up to 1e+09; the scene has 1e+30"),
    (("show", "bracket.toml"), "a[b: unknown key. Allowed: "),
    (("show", "member.toml"), "constrained-x: unknown key. Allowed: "),
    (("show", "two\nlines.toml"), r"the argument 'two\nlines.toml' is not printable text"),
    (("tradeoff", "ball.toml", "-e", "wang", "--budget", "1e300"), "is not in the range"),
    (("run", "--draw", DIGITS), "is not printable text of at most 4096 characters"),
    (("run", "--draw", "9" * 4000), "whole number"),
    (("run", "--draw", "1", "--seed", "9" * 4000), "seed"),
    (("run", "ball.toml", "-e", f"mujoco[spring_steps={'9' * 4000}]"), "it is a number from 0 to 10000"),
]


@pytest.mark.sample(30)
@pytest.mark.parametrize(("arguments", "message"), CASES, ids=range(len(CASES)))
def test_input_that_nobody_means_is_refused_in_one_message(arguments, message, tmp_path):
    """Who reads a pipe or a device waits forever, which ends a process of its own."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    os.mkfifo(tmp_path / "pipe")
    before = sorted(tmp_path.rglob("*"))
    done = (forked if message == NOT_A_FILE else dropspin)(*arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert all(one.isprintable() for one in done.stderr.replace("\n", ""))
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("name", "message"), [("digits.toml", TOO_LARGE), ("deep.toml", "nested too deeply"), ("pipe", NOT_A_FILE), ("/dev/zero", NOT_A_FILE)]
)
def test_a_baseline_that_nobody_means_is_refused(name, message, tmp_path):
    for file, text in FILES.items():
        (tmp_path / file).write_text(text)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ds.DropspinError, match=message):
        ds.load_baseline(tmp_path / name)

"""Which Python the Makefile takes, and its message where there is none: `make` with stubs of Python on its path."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def python(version):
    """A script that behaves like a Python of this version, and writes its own name into the environment that it makes."""
    pretend = f"import sys; sys.version_info = {(*version, 0)}; exec(sys.argv[1])"
    return f"""case "$1" in
    --version) echo "Python {version[0]}.{version[1]}";;
    -m) mkdir -p .venv/bin && echo "$0" > .venv/bin/python;;
    -c) exec "{sys.executable}" -c "{pretend}" "$2";;
esac"""


OLD, SOUND, LATER = python((3, 9)), python((3, 11)), python((3, 14))
NO_VENV = 'case "$*" in *ensurepip*) exit 1;; esac'
SHIM = 'echo "pyenv: command not found" >&2; exit 127'


@pytest.fixture
def make(tmp_path):
    """Run `make .venv/bin/python` with stubs of Python, by name, as the only ones there are."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    programs = tmp_path / "programs"
    programs.mkdir()
    for tool in ("sh", "mkdir"):
        (programs / tool).symlink_to(str(shutil.which(tool)))

    def run(stubs, *arguments):
        for name, script in stubs.items():
            (programs / name).write_text(f"#!/bin/sh\n{script}\n")
            (programs / name).chmod(0o755)
        command = [str(shutil.which("make")), ".venv/bin/python", *arguments]
        return subprocess.run(command, cwd=tmp_path, env={"PATH": str(programs)}, capture_output=True, text=True, check=False)

    return run


@pytest.mark.parametrize(
    ("stubs", "taken"),
    [
        ({"python3.11": SOUND, "python3": LATER}, "python3.11"),
        ({"python3": LATER}, "python3"),
        ({"python3.11": SHIM, "python3": SOUND}, "python3"),
    ],
)
def test_make_prefers_python_3_11_and_takes_any_later_one(make, tmp_path, stubs, taken):
    assert make(stubs).returncode == 0
    assert Path((tmp_path / ".venv/bin/python").read_text().strip()).name == taken


@pytest.mark.parametrize(
    ("stubs", "message"),
    [
        ({"python3": OLD}, "dropspin needs Python 3.11 or later, found: Python 3.9"),
        ({}, "dropspin needs Python 3.11 or later, found: "),
        ({"python3.11": NO_VENV}, "python3.11 cannot make environments; install its module venv"),
    ],
)
def test_make_without_a_usable_python_fails_with_one_line(make, stubs, message):
    done = make(stubs)
    assert done.returncode == 2
    error, end = done.stderr.splitlines()
    assert error.startswith(f"error: {message}")
    assert end.startswith("make: ***")


def test_make_checks_a_python_that_is_named(make, tmp_path):
    done = make({"python3.11": SOUND, "old": OLD}, f"PYTHON={tmp_path / 'programs' / 'old'}")
    assert done.returncode == 2
    assert "found: Python 3.9" in done.stderr

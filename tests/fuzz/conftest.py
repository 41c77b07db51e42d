"""Fixtures of the fuzz campaign."""

import ctypes
import os
import sys
from unittest import mock

import pytest
from support.cli import dropspin

from fuzz.inputs import ACCEPT, BALL_FILE, DRIFT_FILE, RUN, SPEC_FILE

PR_SET_CHILD_SUBREAPER = 36


@pytest.fixture(scope="module", autouse=True)
def _surroundings(tmp_path_factory):
    """Orphaned processes become children of this one, where `cases.run` looks for them; matplotlib has its cache of fonts."""
    is_linux = sys.platform == "linux"
    if is_linux:
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)
    with mock.patch.dict(os.environ, {"MPLCONFIGDIR": str(tmp_path_factory.mktemp("matplotlib"))}):
        yield
    if is_linux:
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 0)


@pytest.fixture(autouse=True)
def _isolated(engine_processes):
    """A case is a whole command, whose processes are counted."""


@pytest.fixture(scope="session")
def sound(shared):
    """A folder with a scene, two runs of it, a baseline of them, a sweep, and a study; tests only copy from it."""

    def make(folder):
        (folder / "ball.toml").write_text(BALL_FILE)
        (folder / "drift.toml").write_text(DRIFT_FILE)
        (folder / "spec.toml").write_text(SPEC_FILE)
        for output in ("run", "run2"):
            assert dropspin(*RUN, "-o", output, cwd=folder).returncode == 0
        for command in (
            ACCEPT,
            ("sweep", "spec.toml", "-o", "sweep"),
            ("tradeoff", "drift.toml", "-e", "wang", "--budget", "0.1", "-o", "study"),
        ):
            done = dropspin(*command, cwd=folder)
            assert done.returncode == 0, done.stderr

    return shared("fuzz", make)

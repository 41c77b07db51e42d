"""Runs of the engine under test and its faulty releases, made once for all tests and workers."""

from functools import cache

import pytest
from support.releases import DTS, RELEASES, SCENES, TODAY, longer, part, relabelled

from comparisons.regressions.baseline import Baseline, accept
from comparisons.results.store import load_results, save
from comparisons.running.run import run


@pytest.fixture(scope="session")
def all_releases(shared):
    """A run of all releases and MuJoCo."""
    return load_results(
        shared("releases", lambda folder: save(run(SCENES, [*(one() for one in RELEASES), "mujoco"], DTS), folder)), arrays=False
    )


@pytest.fixture(scope="session")
def release(all_releases):
    """Call it with a release, and with engines beside it: a run of these, in which the release is the candidate."""

    @cache
    def run_of(kind, *others):
        return relabelled(part(all_releases, engines=[kind.name, *others]), kind.name, "candidate")

    return run_of


@pytest.fixture(scope="session")
def before(all_releases):
    """The run of the first release, and of MuJoCo beside it."""
    return part(all_releases, engines=["candidate", "mujoco"])


@pytest.fixture(scope="session")
def accepted(before):
    """Its results, accepted."""
    return accept(before, Baseline(), "first measured", TODAY)[0]


@pytest.fixture(scope="session")
def longer_fall(shared):
    """A run of fall-spin after the scene has changed."""

    def make(folder):
        [fall] = [scene for scene in SCENES if scene.name == "fall-spin"]
        save(run(longer(fall), [RELEASES[0](), "mujoco"], DTS), folder)

    return load_results(shared("longer-fall", make), arrays=False)

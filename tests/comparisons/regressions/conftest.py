"""Runs of the engine under test and its faulty releases, made once for all tests and workers."""

from dataclasses import replace
from functools import cache

import pytest
from support.brief_runs import all_starts
from support.releases import DTS, RELEASES, SCENES, TODAY, Candidate, longer, part, relabelled

from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.regressions.baseline import Baseline
from dropspin.comparisons.regressions.checking import accept
from dropspin.comparisons.results.store import load_results, save
from dropspin.comparisons.running.run import run


@pytest.fixture(scope="session", autouse=True)
def _compiled():
    """Load the compiled kernels once; the engines' processes are forked and inherit them."""
    for inner in {one.inner for one in RELEASES}:
        for scene in SCENES:
            with engine(inner).prepare(scene, DTS[0]) as simulation:
                simulation.record(2)


@pytest.fixture(scope="module", autouse=True)
def _whole_runs():
    """Tolerances of accepted results follow from the spread over all start phases."""
    with all_starts():
        yield


@pytest.fixture(scope="session")
def kept(shared):
    """Call it with a name and the arguments of a run: its table and provenance, from one run for all workers."""

    def load(name, *asked):
        # Motions are not compared, and take longer to compress than to compute.
        with all_starts():
            folder = shared(name, lambda folder: save(replace(run(*asked), trajectories={}, ensembles={}), folder))
        return load_results(folder, arrays=False)

    return load


@pytest.fixture(scope="session")
def all_releases(kept):
    """A run of all releases and MuJoCo."""
    return kept("releases", SCENES, [*(one() for one in RELEASES), "mujoco"], DTS)


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
def longer_fall(kept):
    """A run of fall-spin after the scene has changed."""
    [fall] = [scene for scene in SCENES if scene.name == "fall-spin"]
    return kept("longer-fall", longer(fall), [Candidate(), "mujoco"], DTS)

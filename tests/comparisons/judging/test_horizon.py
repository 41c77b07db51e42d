"""Results say how much of a scene the exact solution covers: in their reasons, or by their verdict where it covers too little."""

import numpy as np
import pandas as pd
import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.judging.convergence import Claim, SeriesPoint
from dropspin.comparisons.judging.judge import judge
from dropspin.comparisons.measuring.comparison import BeyondHorizon, Unresolved
from dropspin.comparisons.measuring.metric import Average
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.scenarios import truth_for

TILTED = np.array([0.2, -0.3, 0.1, 0.9]) / np.linalg.norm([0.2, -0.3, 0.1, 0.9])
TURNS_OVER = "rounding of the initial state and of the moments of inertia determines when the body turns over"
LIMIT = rf"compared up to t = 6\.8 s, where the exact solution ends: {TURNS_OVER}"


def spinning(**changes):
    """A body that spins about its unstable axis, in a tilted attitude, so that rounding decides when it turns over."""
    from dropspin.scenarios.rotations import rotate

    content = {
        "name": "unstable",
        "duration": 12.0,
        "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0, "inertia": [1.0, 2.0, 2.5]},
        "start": {"orientation": TILTED.tolist(), "angular_velocity": rotate(TILTED, np.array([0.0, 6.0, 0.0])).tolist()},
    }
    return ds.load(content | changes)


def test_results_of_a_limited_solution_state_until_when_they_were_compared():
    """Every metric that is compared with the exact solution, and every agreement; no invariant."""
    found = ds.run([spinning()], [made.Exact(), made.engine_with("other", lambda state, time: state)], dt=[0.01])
    compared = pd.concat([found.table[found.table["kind"] == "truth"], found.agreements])
    assert len(found.agreements) >= 1
    assert len(compared) >= 5
    assert compared["reason"].str.fullmatch(LIMIT).all(), compared["reason"].tolist()
    assert not found.table[found.table["kind"] == "invariant"]["reason"].str.contains("compared up to").any()


def test_results_of_a_solution_for_the_whole_scene_say_nothing():
    found = ds.run([spinning(duration=6.0)], [made.Exact()], dt=[0.01]).table
    assert not found["reason"].str.contains("compared up to").any()


def test_solution_of_too_few_steps_leaves_rows_without_a_truth():
    """A solution until 6.8 s and steps of 1 s: a row for each metric, with the verdict no_truth and the reason."""
    scene = spinning(duration=100.0)
    assert 6.0 < truth_for(scene).horizon < 8.0
    found = ds.run([scene], [made.Exact()], dt=[1.0]).table
    judged = found[found["kind"] == "truth"]
    assert len(judged) >= 5
    assert set(judged["verdict"]) == {"no_truth"}
    assert judged["value"].isna().all()
    assert judged["reason"].str.contains("the exact solution is known for").all()


@pytest.mark.parametrize(
    ("expected", "unresolved", "verdict"),
    [
        ([], BeyondHorizon("short"), "no_truth"),
        ([{"metric": "position_error", "below": 1.0, "reason": "why"}], BeyondHorizon("short"), "failed"),  # an expectation is not lost
        ([], Unresolved("coarse"), "measured"),
    ],
)
def test_only_a_value_that_the_horizon_hides_has_no_truth(expected, unresolved, verdict):
    scene = spinning(expect=expected)
    point = SeriesPoint(0.01, 1200, Average(*np.full((3, 1), np.nan)), None, 0.0, unresolved=unresolved)
    judgement = judge(scene, truth_for(scene), Claim("mine", None, np.float64), METRICS["position_error"], point)
    assert (judgement.verdict, judgement.cause) == (verdict, "unresolved")
    assert "compared up to" not in judgement.reason

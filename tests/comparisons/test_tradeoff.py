"""What accuracy costs: the ladder of steps, the front, and what is recommended. Nothing here depends on how fast anything is."""

import numpy as np
import pytest

from comparisons.measuring.metrics import METRICS
from comparisons.running.recording import simulate
from comparisons.running.run import measure
from comparisons.tradeoff import DIVISIONS, Point, TradeOff, default_metric, output_interval, tradeoff
from scenarios import DropspinError, load

SPIN = load("spin-asymmetric")


def made(*points):
    """A trade-off of points (engine, dt, error, cost in each of three rounds)."""
    return TradeOff(SPIN, "orientation_error", tuple(Point(engine, dt, error, np.array(cost)) for engine, dt, error, cost in points))


def test_steps_divide_the_output():
    """1, 2, 3, 4, 6, 8, …: each some 1.3 to 2 times as many as before, so that every ladder looks at the same times."""
    assert DIVISIONS[:8] == (1, 2, 3, 4, 6, 8, 12, 16)
    assert (np.diff(DIVISIONS) > 0).all()
    assert output_interval(SPIN) == pytest.approx(1.0 / np.linalg.norm(SPIN.start.angular_velocity))


def test_the_front_is_what_nothing_beats_in_both():
    found = made(
        ("fast", 0.1, 1e-1, [1, 1, 1]),
        ("middling", 0.1, 1e-3, [4, 4, 4]),
        ("slow", 0.1, 1e-6, [9, 9, 9]),
        ("beaten", 0.1, 1e-3, [5, 5, 5]),
        ("beaten", 0.2, 2e-1, [2, 2, 2]),
    )
    assert [point.engine for point in found.front] == ["fast", "middling", "slow"]
    assert found.dominated == ["beaten"]


def test_the_cheapest_within_a_tolerance():
    """By the median of the rounds; and the next best by the median of the rounds' ratios, which a disturbed round does not move."""
    found = made(("a", 0.1, 1e-4, [2, 20, 2]), ("b", 0.1, 1e-4, [6, 60, 6]), ("c", 0.1, 1e-2, [1, 1, 1]))
    advice = found.recommendation(1e-3)
    assert (advice.best.engine, advice.next_best.engine, advice.ratio, advice.level) == ("a", "b", 3.0, False)
    assert found.recommendation(1e-9) is None
    assert found.recommendation(1e-1).best.engine == "c"


def test_side_by_side_is_a_choice_of_its_own():
    """The cheapest of each of many is among the engines that can take many, at the step that the tolerance asks for."""
    ways = [("lanes", 0.2, 1e-2, 1e-8), ("lanes", 0.1, 1e-4, 2e-8), ("threads", 0.1, 1e-4, 3e-8), ("alone", 0.1, 1e-5, np.nan)]
    points = tuple(Point(engine, dt, error, np.array([1.0]), cost) for engine, dt, error, cost in ways)
    found = TradeOff(SPIN, "orientation_error", points)
    best = found.best_side_by_side(1e-3)
    assert (best.engine, best.dt) == ("lanes", 0.1)
    assert found.best_side_by_side(1e-5) is None
    assert [(point.engine, point.dt) for point in found.front_side_by_side] == [("lanes", 0.2), ("lanes", 0.1)]


@pytest.mark.parametrize("costs", [([2, 2, 2], [2.2, 2.2, 2.2]), ([2, 2, 2], [1.9, 3.5, 1.9, 3.5][:3])])
def test_what_changes_places_is_level(costs):
    found = made(("a", 0.1, 1e-4, costs[0]), ("b", 0.1, 1e-4, costs[1]))
    assert found.recommendation(1e-3).level


def test_an_error_that_crosses_zero_is_luck():
    """A coarse step that happens to be accurate is not recommended where a finer one is not."""
    found = made(("a", 0.4, 1e-5, [1, 1, 1]), ("a", 0.2, 1e-2, [2, 2, 2]), ("a", 0.1, 1e-4, [4, 4, 4]))
    assert found.recommendation(1e-3).best.dt == 0.1


def test_what_a_scene_is_about():
    about = {"spin-asymmetric": "orientation_error", "drop-ball": "bounce_height_error", "slide-box": "position_error"}
    assert {name: default_metric(load(name)) for name in about} == about


@pytest.fixture(scope="module")
def spin():
    """Three rotations and the note, of a spin of 6 s."""
    engines = ["document", "document[rotation=midpoint]", "document[rotation=rk4]", "document[rotation=exact]"]
    return tradeoff(SPIN.model_copy(update={"duration": 6.0}), engines)


def test_what_is_recommended_is_confirmed(spin):
    """Run at the step that is recommended, the error is what was said, and so it is at half the step."""
    for within in (1e-2, 1e-4, 1e-8):
        best = spin.recommendation(within).best
        every = round(output_interval(spin.scene) / best.dt)
        motion = simulate(spin.scene, best.engine, best.dt, every=every)
        found = abs(measure(spin.scene, motion)["orientation_error"])
        assert found == pytest.approx(best.error, rel=1e-9)
        assert found <= within
        finer = simulate(spin.scene, best.engine, best.dt / 2, every=2 * every)
        assert abs(measure(spin.scene, finer)["orientation_error"]) <= within


def test_errors_fall_by_their_order(spin):
    """On the ladder: midpoint by 4 and rk4 by 16 at half the step, to a tenth of the order, where they are neither coarse nor rounding."""
    for engine, order in (("document[rotation=midpoint]", 2.0), ("document[rotation=rk4]", 4.0)):
        mine = [point for point in spin.points if point.engine == engine and 1e-10 < point.error < 1e-3]
        slope = np.polyfit(np.log([point.dt for point in mine]), np.log([point.error for point in mine]), 1)[0]
        assert slope == pytest.approx(order, abs=0.1)


def test_what_does_not_converge_is_left_out(spin):
    """The note has no gyroscopic term: it is another motion, whatever the step, and by no metric worth its time."""
    assert "does not converge" in spin.left_out["document"]
    assert {point.engine for point in spin.points} == {f"document[rotation={name}]" for name in ("midpoint", "rk4", "exact")}
    assert min(point.error for point in spin.points if "exact" in point.engine) < 1e-13


def test_the_energy_of_another_motion_is_worth_nothing():
    """The note keeps the energy of a spin that it gets wrong, and is left out by that metric too; midpoint keeps that of the right one."""
    short = SPIN.model_copy(update={"duration": 10.0})
    found = tradeoff(short, ["document", "document[rotation=midpoint]", "document[rotation=rk4]"], metric="energy_error")
    assert "does not converge: orientation error" in found.left_out["document"]
    of = {name: [point.error for point in found.points if name in point.engine] for name in ("midpoint", "rk4")}
    assert max(of["midpoint"]) < 1e-11  # measured 1e-13, at steps of a radian too
    assert of["rk4"][0] > 1e-4


def test_every_cost_is_a_time(spin):
    for point in spin.points:
        assert np.isfinite(point.cost).all()
        assert (point.cost > 0).all()


def test_who_declines_is_left_out_with_the_reason():
    short = load("drop-ball").model_copy(update={"duration": 0.6})
    found = tradeoff(short, ["mujoco", "mujoco[integrator=rk4]"])
    assert "RK4 has no restitution" in found.left_out["mujoco[integrator=rk4]"]
    assert {point.engine for point in found.points} == {"mujoco"}
    assert METRICS[found.metric].unit == "1"


def test_what_cannot_be_traded():
    with pytest.raises(DropspinError, match="metric 'restitution_error' is unknown"):
        tradeoff(SPIN, ["mujoco"], metric="restitution_error")
    with pytest.raises(DropspinError, match=r"no engine runs drop-ball: mujoco\[integrator=rk4\]: RK4 has no restitution"):
        tradeoff(load("drop-ball"), ["mujoco[integrator=rk4]"])

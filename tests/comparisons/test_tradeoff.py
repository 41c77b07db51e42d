"""The trade-off study: the ladder of steps, the Pareto front, and the recommendation. No assertion depends on the machine's speed."""

import mmap
import os
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.accuracy_options import InnerStep
from support.engines import Exact, ExactSimulation, Together

from dropspin.comparisons.engines.base import BatchSimulation, Diverged
from dropspin.comparisons.measuring.metrics import METRICS, leading_metric
from dropspin.comparisons.running import timing
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown, simulate
from dropspin.comparisons.running.process_limits import FIVE_MINUTES
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.run import measure
from dropspin.comparisons.tradeoff import costs, study
from dropspin.comparisons.tradeoff import ladder as ladder_module
from dropspin.comparisons.tradeoff.ladder import DIVISIONS, Ladder, output_interval
from dropspin.comparisons.tradeoff.pareto import CostPoint, TradeOff, spread
from dropspin.comparisons.tradeoff.study import tradeoff
from dropspin.reports.stories.tradeoff import sentences
from dropspin.scenarios import DropspinError, load

SPIN = load("spin-asymmetric")


def made(*points):
    """A trade-off of points (engine, dt, error, cost in each of three rounds)."""
    return found_with(CostPoint(engine, dt, error, np.array(cost)) for engine, dt, error, cost in points)


def found_with(points):
    points = tuple(points)
    names = dict.fromkeys(point.engine for point in points)
    ladders = [Ladder(name, tuple((point.dt, point.error) for point in points if point.engine == name), "budget", "") for name in names]
    return TradeOff(SPIN, "orientation_error", points, tuple(ladders))


def test_steps_divide_the_output_interval():
    """1, 2, 3, 4, 6, 8, …: each 1.3 to 2 times as many as before, so that all steps have states at the same times."""
    assert DIVISIONS[:8] == (1, 2, 3, 4, 6, 8, 12, 16)
    assert (np.diff(DIVISIONS) > 0).all()
    assert output_interval(SPIN) == pytest.approx(1.0 / np.linalg.norm(SPIN.start.angular_velocity))


def test_pareto_front_has_no_point_that_is_beaten_in_error_and_cost():
    found = made(
        ("fast", 0.1, 1e-1, [1, 1, 1]),
        ("middling", 0.1, 1e-3, [4, 4, 4]),
        ("slow", 0.1, 1e-6, [9, 9, 9]),
        ("beaten", 0.1, 1e-3, [5, 5, 5]),
        ("beaten", 0.2, 2e-1, [2, 2, 2]),
    )
    assert [point.engine for point in found.pareto_front] == ["fast", "middling", "slow"]
    [(beaten, by)] = found.dominated.items()
    assert (beaten.engine, beaten.dt, by.engine) == ("beaten", 0.1, "middling")  # its most accurate, and the cheapest that is as accurate


def test_recommendation_is_the_cheapest_within_the_tolerance():
    """By the median cost of the rounds; the ratio is the median of the rounds' ratios, which a disturbed round does not change."""
    found = made(("a", 0.1, 1e-4, [2, 20, 2]), ("b", 0.1, 1e-4, [6, 60, 6]), ("c", 0.1, 1e-2, [1, 1, 1]))
    advice = found.recommendation(1e-3)
    assert (advice.best.engine, advice.next_best.engine, advice.ratio, advice.level) == ("a", "b", 3.0, False)
    assert found.recommendation(1e-9) is None
    assert found.recommendation(1e-1).best.engine == "c"


def test_best_in_batch_is_among_engines_with_batches():
    """By cost per world, at a time step within the tolerance."""
    lanes, threads = [("lanes", 0.2, 1e-2, {256: 1e-8}), ("lanes", 0.1, 1e-4, {256: 2e-8})], ("threads", 0.1, 1e-4, {16: 1e-9, 256: 3e-8})
    ways = [*lanes, threads, ("alone", 0.1, 1e-5, {})]
    found = found_with(CostPoint(engine, dt, error, np.array([1.0]), costs) for engine, dt, error, costs in ways)
    best = found.best_in_batch(1e-3, 256)
    assert (best.engine, best.dt) == ("lanes", 0.1)
    assert found.best_in_batch(1e-5, 256) is None
    assert found.best_in_batch(1e-3, 16).engine == "threads"
    assert [(point.engine, point.dt) for point in found.batch_pareto_front(256)] == [("lanes", 0.2), ("lanes", 0.1)]


@pytest.mark.parametrize("rounds", [([2, 2, 2], [2.2, 2.2, 2.2]), ([2, 2, 2], [1.9, 3.5, 1.9, 3.5][:3])])
def test_costs_that_are_close_or_change_order_are_level(rounds):
    found = made(("a", 0.1, 1e-4, rounds[0]), ("b", 0.1, 1e-4, rounds[1]))
    assert found.recommendation(1e-3).level


def test_coarse_step_is_not_recommended_if_a_finer_one_exceeds_the_tolerance():
    """Its error is small by chance, where it crosses 0."""
    found = made(("a", 0.4, 1e-5, [1, 1, 1]), ("a", 0.2, 1e-2, [2, 2, 2]), ("a", 0.1, 1e-4, [4, 4, 4]))
    assert found.recommendation(1e-3).best.dt == 0.1


def test_error_that_grows_by_rounding_at_much_finer_steps_does_not_count():
    """In single precision; four times as fine is not much finer."""
    steps = [(0.4 / 2**number, error) for number, error in enumerate([1e-4, 1e-5, 1e-6, 1e-4, 1e-2, 1e-1])]
    found = made(*(("single", dt, error, [1 / dt] * 3) for dt, error in steps))
    assert found.recommendation(1e-3).best.dt == 0.4
    assert [found.reached(point) for point in found.points] == [1e-4, 1e-4, 1e-2, 1e-1, 1e-1, 1e-1]
    assert [point.dt for point in found.pareto_front] == [0.4]


@pytest.mark.parametrize(("ended", "recommended"), [("budget", None), ("failed", 0.4)])
def test_step_is_recommended_only_if_finer_ones_have_errors(ended, recommended):
    """Unless the process failed at the last one, where it may have exceeded its time."""
    [point] = made(("a", 0.4, 1e-5, [1, 1, 1])).points
    advice = TradeOff(SPIN, "orientation_error", (point,), (Ladder("a", ((0.4, 1e-5), (0.2, np.nan)), ended, ""),)).recommendation(1e-3)
    assert (advice and advice.best.dt) == recommended


def test_engine_whose_small_error_does_not_fall_is_compared():
    """An error of 1e-5 rad at all time steps is within 1e-3 rad; one of 0.1 rad is that of another motion."""
    tried = [(0.1 / 2**number, [1e-5, 1e-5]) for number in range(8)]
    assert ladder_module._left_out(SPIN, tried, "orientation_error", "") == ""
    large = [(dt, [1e-5, 0.1]) for dt, _ in tried]
    assert ladder_module._left_out(SPIN, large, "orientation_error", "").startswith(
        "no convergence observed: orientation error is 0.1 to 0.1 rad"
    )


def test_recommendation_is_on_the_pareto_front_if_a_finer_step_took_less_time():
    """Timings of short steps scatter."""
    found = made(("a", 0.4, 1e-4, [3, 3, 3]), ("a", 0.2, 1e-5, [2, 2, 2]), ("a", 0.1, 1e-6, [4, 4, 4]))
    best = found.recommendation(1e-3).best
    assert best.dt == 0.2
    assert best in found.pareto_front


def test_error_that_is_small_by_chance_beats_none():
    """Neither is it on the Pareto front for its own accuracy, nor is another engine dominated by it, or by one that diverges."""
    found = made(("a", 0.4, 1e-9, [1, 1, 1]), ("a", 0.2, 1e-2, [2, 2, 2]), ("b", 0.2, 1e-3, [3, 3, 3]), ("c", 0.2, 1e-2, [4, 4, 4]))
    assert [(point.engine, point.dt) for point in found.pareto_front] == [("a", 0.4), ("b", 0.2)]
    assert [(point.engine, other.engine, other.dt) for point, other in found.dominated.items()] == [("c", "a", 0.4)]
    diverging = TradeOff(
        SPIN, "orientation_error", found.points, (*found.ladders[1:], Ladder("a", ((0.4, 1e-9), (0.2, np.nan)), "budget", ""))
    )
    assert [point.engine for point in diverging.pareto_front] == ["b"]
    assert [(point.engine, other.engine) for point, other in diverging.dominated.items()] == [("c", "b")]


def test_leading_metric_depends_on_the_scene():
    expected = {"spin-asymmetric": "orientation_error", "drop-ball": "bounce_height_error", "slide-box": "position_error"}
    assert {name: leading_metric(load(name)) for name in expected} == expected


@pytest.fixture(scope="module", autouse=True)
def short_timings():
    """Two rounds instead of nine, 400 steps with a floor: no assertion depends on the machine's speed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "ROUNDS", 2)
        patch.setattr(ladder_module, "MOST_RECORDED", 400)
        yield


CALL, STEP = 2.5e-3, 6e-6  # s, as of MJX on a processor


class CostlyCalls(Exact):
    """Each call of `advance` takes some time beside that of its steps, on a clock of its own; a batch has the steps of its worlds."""

    name = "costly-calls"
    clock = 0.0

    def pass_time(self, steps):
        CostlyCalls.clock += CALL + STEP * steps

    def prepare(self, scene, dt):
        made = super().prepare(scene, dt)
        advance = made.advance
        made.advance = lambda steps: (self.pass_time(steps), advance(steps))
        return made

    def prepare_batch(self, members, dt):
        return CostlyBatch(self, members, dt)


class CostlyBatch(Together):
    def __init__(self, engine, members, dt, substeps=1):
        super().__init__([Exact.prepare(engine, member, dt) for member in members])
        self._pass_time = lambda steps: engine.pass_time(steps * substeps * len(members))

    def advance(self, steps):
        super().advance(steps)
        self._pass_time(steps)


@pytest.mark.parametrize("dt", [1e-2, 1e-3])
def test_cost_of_a_step_in_flight_is_without_that_of_the_call(monkeypatch, dt):
    """To 1e-9, where one call costs as much as four hundred steps."""
    monkeypatch.setattr(timing.time, "perf_counter", lambda: CostlyCalls.clock)
    entry = EngineEntry("costly-calls", CostlyCalls())
    assert costs.cost(entry, SPIN, dt) == pytest.approx(STEP / dt, rel=1e-9)
    assert costs.costs_per_world(entry, SPIN, [(dt, 1.0), (2 * dt, 1.0)], 4) == (
        pytest.approx([STEP / dt, STEP / (2 * dt)], rel=1e-9),
        None,
    )


class Settling(CostlyCalls):
    """Its first 40 steps take a hundred times as long as the later ones, as of an engine that divides steps while the body turns fast."""

    name = "settling"

    def prepare(self, scene, dt):
        made = Exact.prepare(self, scene, dt)
        advance = made.advance

        def passing(steps):
            first = made._step
            advance(steps)
            self.pass_time(sum(100 if step < 40 else 1 for step in range(first, first + steps)))

        made.advance = passing
        return made


def test_damped_flight_is_timed_whole_unless_that_takes_long(monkeypatch):
    """Beyond its end the body is at rest, where a step may cost less; of a long run, so many steps are timed that the call is short."""
    monkeypatch.setattr(timing.time, "perf_counter", lambda: CostlyCalls.clock)
    damped, entry = load("spin-damped"), EngineEntry("settling", Settling())
    dt = damped.duration / 100
    monkeypatch.setattr(costs, "LONGEST_RUN", 1.0)
    whole = (38 * 100 + 62 - 100) / 99  # of the 100 steps after the first two, without the call and its step
    assert costs.cost(entry, damped, dt) == pytest.approx(whole * STEP / dt, rel=1e-9)
    monkeypatch.setattr(costs, "LONGEST_RUN", 1e-3)
    assert costs.cost(entry, damped, dt) < 0.3 * whole * STEP / dt


class SlowStart(CostlyCalls):
    """The first call of each simulation does work that takes as long as a thousand steps."""

    def prepare(self, scene, dt):
        made = super().prepare(scene, dt)
        advance, extra = made.advance, [8e-3]
        made.advance = lambda steps: (self.pass_time(extra.pop() / STEP if extra else 0), advance(steps))
        return made


def test_work_that_a_simulation_does_once_is_no_part_of_its_steps(monkeypatch):
    monkeypatch.setattr(timing.time, "perf_counter", lambda: CostlyCalls.clock)
    timed = timing.time_steps(SlowStart(), SPIN, 1e-3, 3000)
    assert timing.time_per_step([timed]) == pytest.approx(STEP, rel=1e-9)


class Substeps(CostlyCalls):
    """Divides each step into equal ones of 1 ms."""

    def prepare_batch(self, members, dt):
        return CostlyBatch(self, members, dt, round(1e3 * dt))


def test_cost_per_world_of_an_engine_that_divides_its_steps(monkeypatch):
    """It is the same at all steps, and timed at each: it is not derived from that at the smallest."""
    monkeypatch.setattr(timing.time, "perf_counter", lambda: CostlyCalls.clock)
    entry = EngineEntry("substeps", Substeps())
    assert costs.costs_per_world(entry, SPIN, [(1e-2, 1.0), (1e-3, 1.0)], 4) == (pytest.approx([STEP / 1e-3] * 2, rel=1e-9), None)


class Idle(Together):
    """Takes no step."""

    def advance(self, steps):
        pass


class Reusing(Together):
    """Gives its own memory, which the next simulation uses."""

    def states(self):
        self._memory = super().states()
        return self._memory

    def close(self):
        self._memory[:] = np.nan


class Failing(Together):
    """Fails at 20 ms."""

    def advance(self, steps):
        super().advance(steps)
        if self._simulations[0]._dt == 0.02:
            raise RuntimeError("no memory")


class NotFinite(Together):
    """Its last world is not finite after some steps."""

    def states(self):
        states = super().states()
        states[-1] *= np.nan if self._simulations[0]._step > 60 else 1.0
        return states


@pytest.mark.parametrize(
    ("batch", "are_timed", "verdict", "reason"),
    [
        (Together, [True, True], None, ""),
        (Reusing, [True, True], None, ""),
        (Failing, [True, False], "crashed", "RuntimeError: no memory"),
        (NotFinite, [False, False], "diverged", "the state is not finite"),
        (Idle, [False, False], "failed", "the states of a batch are not those of a single simulation"),
    ],
)
def test_batch_without_a_cost_has_the_reason(batch, are_timed, verdict, reason):
    """Which is that of its ladder, with the verdict; an engine without batches has none."""

    def prepare_batch(self, members, dt):
        return batch([self.prepare(member, dt) for member in members])

    engine = type("Batched", (Exact,), {"name": "batched", "prepare_batch": prepare_batch})()
    times, failure = costs.costs_per_world(EngineEntry("batched", engine), SPIN, [(1e-2, 1.0), (2e-2, 1.0)], 4)
    assert np.isfinite(times).tolist() == are_timed
    ladder = study._with_failures(Ladder("batched", (), "budget", ""), True, failure)
    assert (ladder.verdict, ladder.no_batch_cost) == (verdict, reason)
    _, without = costs.costs_per_world(EngineEntry("exact", Exact()), SPIN, [(1e-2, 1.0)], 4)
    assert study._with_failures(ladder, True, without) == ladder


@pytest.mark.parametrize(("apart", "timed"), [(1e-4, [True, False]), (2e-3, [False, False])])
def test_batch_that_errs_more_than_a_single_simulation_has_no_cost(apart, timed):
    """At the time steps at which its first steps do; at none, if they differ as much as those of another method."""

    def prepare_batch(self, members, dt):
        rows = [
            ExactSimulation(member, dt, lambda row, time: row * (1.0 + apart * min(time, 1.0) * (np.arange(13) > 9))) for member in members
        ]
        return Together(rows)

    entry = EngineEntry("other", type("Other", (Exact,), {"name": "other", "prepare_batch": prepare_batch})())
    times, failure = costs.costs_per_world(entry, SPIN, [(1.0, 1e-2), (0.5, 1e-6)], 4)
    assert np.isfinite(times).tolist() == timed
    assert (failure and failure.reason) == (None if any(timed) else "the states of a batch are not those of a single simulation")


@pytest.fixture(scope="module")
def spin():
    """Wang's method and three other rotations, on a spin of 6 s."""
    engines = ["wang", "wang[rotation=midpoint]", "wang[rotation=rk4]", "wang[rotation=exact]"]
    return tradeoff(SPIN.model_copy(update={"duration": 6.0}), engines)


@pytest.mark.extended
def test_errors_do_not_depend_on_the_number_of_jobs_and_costs_are_measured_alone(monkeypatch):
    """No errors are being measured at the time."""
    running, measure_errors, measure_costs = set(), study.errors_over_steps, study._with_costs

    def errors_over_steps(entry, *given):
        running.add(entry.label)
        ladder = measure_errors(entry, *given)
        running.remove(entry.label)
        return ladder

    def with_costs(*given):
        assert not running
        return measure_costs(*given)

    monkeypatch.setattr(study, "errors_over_steps", errors_over_steps)
    monkeypatch.setattr(study, "_with_costs", with_costs)
    monkeypatch.setattr(ladder_module, "MOST_STEPS", 200)
    engines = ["mujoco[integrator=rk4]", "wang[rotation=rk4]"]
    one, two = (tradeoff(SHORT, engines, worlds=[2], jobs=jobs) for jobs in (1, 2))
    assert one.ladders == two.ladders
    assert [(point.engine, point.dt, point.error) for point in one.points] == [
        (point.engine, point.dt, point.error) for point in two.points
    ]


@pytest.mark.extended
def test_recommended_step_has_the_stated_error(spin):
    """Also the errors at half the step are within the tolerance."""
    for within in (1e-2, 1e-4, 1e-8):
        best = spin.recommendation(within).best
        every = round(output_interval(spin.scene) / best.dt)
        motion = simulate(spin.scene, best.engine, best.dt, every=every)
        found = abs(measure(spin.scene, motion)["orientation_error"])
        assert found == pytest.approx(best.error, rel=1e-9)
        assert found <= within
        finer = simulate(spin.scene, best.engine, best.dt / 2, every=2 * every)
        assert abs(measure(spin.scene, finer)["orientation_error"]) <= within


@pytest.mark.extended
def test_errors_fall_by_their_order(spin):
    """Midpoint by 4 and rk4 by 16 per halved step, to a tenth of the order, where neither coarse steps nor rounding dominate."""
    for engine, order in (("wang[rotation=midpoint]", 2.0), ("wang[rotation=rk4]", 4.0)):
        mine = [point for point in spin.points if point.engine == engine and 1e-10 < point.error < 1e-3]
        slope = np.polyfit(np.log([point.dt for point in mine]), np.log([point.error for point in mine]), 1)[0]
        assert slope == pytest.approx(order, abs=0.1)


def test_engine_that_does_not_converge_is_left_out(spin):
    """Wang's method has no gyroscopic term: it converges to another motion."""
    assert spin.left_out["wang"].startswith("no convergence observed: orientation error is 1.")
    [ladder] = [one for one in spin.ladders if one.engine == "wang"]
    coarsest, finest = (f"{1e3 * dt:.4g} ms" for dt, _ in (ladder.steps[0], ladder.steps[-1]))
    assert spin.left_out["wang"].endswith(f"at the {len(ladder.steps)} time steps tried, {coarsest} to {finest}")
    assert {point.engine for point in spin.points} == {f"wang[rotation={name}]" for name in ("midpoint", "rk4", "exact")}
    assert min(point.error for point in spin.points if "exact" in point.engine) < 1e-13


def test_metric_is_compared_where_that_of_the_motion_is_undefined():
    """A capsule flies too briefly after its first impact to have a bounce height, but has an orientation."""
    body = {"shape": "capsule", "radius": 0.05, "half_length": 0.1, "mass": 0.5}
    start = {"position": [0.0, 0.5, 0.0], "orientation": [0.3, 0.2, 0.5, 0.8], "angular_velocity": [1.0, 2.0, -3.0]}
    floor = {"gravity": {"acceleration": [1.0, -9.8, 0.0]}, "floor": {"restitution": 0.5, "friction": 0.3}}
    found = tradeoff(load({"duration": 1.2, "body": body, "start": start, **floor}), ["mujoco"], metric="orientation_error", budget=0.1)
    assert found.points
    assert not found.left_out


@pytest.mark.extended
def test_engine_that_conserves_the_energy_of_a_wrong_motion_is_left_out():
    """Wang's method keeps the energy of a spin that it gets wrong; midpoint keeps that of the right one."""
    short = SPIN.model_copy(update={"duration": 10.0})
    found = tradeoff(short, ["wang", "wang[rotation=midpoint]", "wang[rotation=rk4]"], metric="energy_error")
    assert "no convergence observed: orientation error" in found.left_out["wang"]
    of = {name: [point.error for point in found.points if name in point.engine] for name in ("midpoint", "rk4")}
    assert max(of["midpoint"]) < 1e-11  # measured 1e-13, at steps of a radian too
    assert of["rk4"][0] > 1e-4


class Clock:
    """A clock that engines of a test advance."""

    now = 0.0


class FirstOrder(Exact):
    """Turns too fast by a share of the step, and takes 1 ms of processor time per step; below `smallest` it ends its process."""

    name = "first-order"
    smallest = 0.0

    def prepare(self, scene, dt):
        if dt < self.smallest:
            os.abort()
        simulation = ExactSimulation(scene, dt)
        simulation._truth = lambda t, truth=simulation._truth: truth(t * (1.0 + 0.1 * dt))
        record = simulation.record
        simulation._truth.horizon = np.inf

        def counted(steps, every=1):
            Clock.now += 1e-3 * steps
            return record(steps, every)

        simulation.record = counted
        return simulation


class Aborting(FirstOrder):
    """The same, but its process ends at steps below 50 ms."""

    name = "fails-below-50-ms"
    smallest = 0.05


class Never(Exact):
    """Gives up at every step."""

    name = "never"

    def prepare(self, scene, dt):
        raise Diverged("no step is small enough")


SHORT = SPIN.model_copy(update={"duration": 4.0})


@pytest.fixture
def _processor_time_of_the_steps(monkeypatch):
    monkeypatch.setattr(ladder_module, "processor_time", lambda: Clock.now)


class NoNumbers(Exact):
    """Has no numbers at steps below 50 ms, where it is right above."""

    name = "no-numbers"

    def prepare(self, scene, dt):
        return ExactSimulation(scene, dt, (lambda row, time: row * np.nan) if dt < 0.05 else None)


@pytest.mark.parametrize(("engine", "why"), [(Never(), "no step is small enough"), (NoNumbers(), "the state is not finite at t = ")])
def test_time_steps_without_an_error_have_the_reason(engine, why, monkeypatch):
    monkeypatch.setattr(ladder_module, "MOST_STEPS", 100)
    with EngineProcesses(FIVE_MINUTES) as processes:
        ladder = ladder_module.errors_over_steps(EngineEntry(engine.name, engine), SHORT, ["orientation_error"] * 2, 1.0, processes)
    assert ladder.undefined.startswith(why)
    assert ladder.verdict is None
    assert (f": {why}" in ladder.left_out) == isinstance(engine, Never)


class Raising(FirstOrder):
    """Raises an exception of its own at steps above `largest`."""

    name = "raising"
    largest = 0.3

    def prepare(self, scene, dt):
        if dt > self.largest:
            raise RuntimeError("the step is too large")
        return super().prepare(scene, dt)


@pytest.mark.usefixtures("_processor_time_of_the_steps")
def test_engine_that_raises_at_coarse_steps_alone_is_compared(monkeypatch):
    """With the exit code of an engine that breaks down, and the steps in a sentence; one that always raises was not run."""
    monkeypatch.setattr(ladder_module, "MOST_STEPS", 100)
    always = type("Always", (Raising,), {"name": "always", "largest": 0.0})()
    found = tradeoff(SHORT, [Raising(), always])
    raising, failing = found.ladders
    assert [np.isnan(error) for dt, error in raising.steps] == [dt > 0.3 for dt, _ in raising.steps]
    assert raising.steps[0][0] > 0.3 > raising.steps[-1][0]
    assert (raising.left_out, raising.verdict, raising.undefined) == ("", "crashed", "RuntimeError: the step is too large")
    assert (failing.ended, failing.verdict, failing.left_out) == ("not_run", "crashed", "RuntimeError: the step is too large")
    [sentence] = [text for text in sentences(found, []) if "too large: raising" in text]
    assert sentence.startswith("No error at ")


def test_engine_within_a_tolerance_is_compared_though_its_error_does_not_fall():
    """An error of 0.05 rad; only if the tolerance is about the motion."""

    class Tilted(Exact):
        name = "tilted"

        def prepare(self, scene, dt):
            return ExactSimulation(scene, dt, lambda row, time: row if time == 0.0 else tilted(row))

    def tilted(row):
        return np.concatenate([row[:3], (Rotation.from_quat(row[3:7]) * Rotation.from_rotvec([0.05, 0.0, 0.0])).as_quat(), row[7:]])

    def left_out(metrics, within):
        with EngineProcesses(FIVE_MINUTES) as processes:
            entry = EngineEntry("tilted", Tilted())
            return ladder_module.errors_over_steps(entry, SHORT, metrics, 1.0, processes, within).left_out

    assert left_out(["orientation_error"] * 2, 0.06) == ""
    assert left_out(["orientation_error"] * 2, 0.04).startswith("no convergence observed")
    assert left_out(["position_error", "orientation_error"], 0.06).startswith("no convergence observed")


class Growing(Exact):
    """Diverges soon after the end of the scene at the coarsest time step, alone and in a batch."""

    name = "growing"

    def prepare(self, scene, dt):
        simulation = ExactSimulation(scene, dt)
        advance = simulation.advance

        def diverging(steps):
            advance(steps)
            if dt > 0.3 and simulation._step > scene.steps(dt):
                raise Diverged("too fast")

        simulation.advance = diverging
        return simulation

    def prepare_batch(self, members, dt):
        return Together([self.prepare(member, dt) for member in members])


def test_batch_that_diverges_where_a_single_simulation_does_has_no_fault(monkeypatch):
    monkeypatch.setattr(ladder_module, "MOST_STEPS", 30)
    found = tradeoff(SHORT, Growing(), worlds=[2])
    [ladder] = found.ladders
    assert (ladder.verdict, ladder.no_batch_cost) == (None, "")
    assert [dt for dt, _ in ladder.steps][1:] == [point.dt for point in found.points if 2 in point.costs_per_world]
    assert ladder.steps[0][0] > 0.3 > ladder.steps[1][0]


def test_angles_that_stay_large_at_coarse_steps_may_fall_at_finer_ones():
    """A brick that turns by 70 rad: the orientation is about π off at ten time steps, and converges at first order below 1 ms."""
    brick = {"shape": "box", "half_extents": [0.1, 0.2, 0.3], "mass": 1.0, "inertia": [0.03, 0.02, 0.01]}
    fast = {"duration": 6.0, "body": brick, "start": {"angular_velocity": [3.0, 10.0, 5.0]}}
    for metric in ("orientation_error", "energy_error"):  # which is small at once
        found = tradeoff(fast, "wang[rotation=gyroscopic]", metric, worlds=[1])
        assert np.nanmin([error for _, error in found.ladders[0].steps]) < 0.01
        assert not found.left_out


@pytest.mark.usefixtures("_processor_time_of_the_steps")
@pytest.mark.parametrize("budget", [0.05, 0.2, 1.0])
def test_ladder_ends_where_the_budget_of_processor_time_is_spent(budget):
    """The steps tried are those whose processor times, all but the last, are together within the budget; more budget, more steps."""
    found = tradeoff(SHORT, [FirstOrder()], budget=budget)
    [ladder] = found.ladders
    spent = np.cumsum([1e-3 * SHORT.steps(dt) for dt, _ in ladder.steps])
    assert spent[-2] < budget <= spent[-1]
    assert (ladder.ended, ladder.reason) == ("budget", f"the budget of {budget:g} s of processor time was spent")
    assert all(finer < 0.9 * coarser for (_, coarser), (_, finer) in pairwise(ladder.steps))  # it could have gone on


@pytest.mark.extended
@pytest.mark.usefixtures("_processor_time_of_the_steps")
@pytest.mark.usefixtures("engine_processes")
def test_every_engine_that_was_asked_for_has_a_ladder_with_the_reason_of_its_end():
    names = ["wang[rotation=exact]", "mujoco[integrator=rk4]"]
    found = tradeoff(SHORT, [FirstOrder(), Aborting(), Never(), *names], budget=0.5)
    ladders = {ladder.engine: ladder for ladder in found.ladders}
    assert {name: (one.ended, bool(one.left_out)) for name, one in ladders.items()} == {
        "first-order": ("budget", False),
        "fails-below-50-ms": ("failed", False),
        "never": ("longest_run", True),
        names[0]: ("error_stopped_falling", False),
        names[1]: ("error_stopped_falling", False),
    }
    failing = ladders["fails-below-50-ms"]
    assert failing.reason == "its process was ended by SIGABRT"
    assert [np.isfinite(error) for dt, error in failing.steps] == [dt >= 0.05 for dt, _ in failing.steps]
    assert failing.steps[-1][0] < 0.05
    assert len([point for point in found.points if point.engine == failing.engine]) == len(failing.steps) - 1


def test_ladder_that_ends_at_the_longest_run_says_so(monkeypatch):
    monkeypatch.setattr(ladder_module, "MOST_STEPS", 60)
    [ladder] = tradeoff(SHORT, ["mujoco"]).ladders
    assert (ladder.ended, ladder.reason) == ("longest_run", "a run at the next smaller time step would have more than 60 steps")
    assert 60 / 1.5 <= SHORT.steps(ladder.steps[-1][0]) <= 60


class NoCost(Exact):
    """Fails when it is timed."""

    name = "no-cost"

    def prepare(self, scene, dt):
        simulation = ExactSimulation(scene, dt)
        simulation.advance = None
        return simulation


def test_engine_whose_cost_cannot_be_measured_is_left_out_with_the_reason():
    found = tradeoff(SHORT, [NoCost(), "wang[rotation=exact]"])
    assert list(found.left_out) == ["no-cost"]
    assert "cost could not be measured" in found.left_out["no-cost"]
    assert [ladder.verdict for ladder in found.ladders] == ["crashed", None]
    with pytest.raises(DropspinError, match="no engine can be compared in spin-asymmetric: no-cost: its cost could not be measured"):
        tradeoff(SHORT, [NoCost()])


@pytest.mark.parametrize("budget", [0.0, -1.0, np.nan, np.inf, "3", None])
def test_budget_must_be_a_time_above_0(budget):
    with pytest.raises(DropspinError, match="budget: got"):
        tradeoff(SHORT, ["mujoco"], budget=budget)


@pytest.mark.parametrize("worlds", [4, [], [0], [4.0], [4, "8"], "4", [[4]], None])
def test_worlds_must_be_a_list_of_numbers(worlds):
    with pytest.raises(DropspinError, match=r"worlds: got .* a list of whole numbers from 1 to 1048576"):
        tradeoff(SHORT, ["mujoco"], worlds=worlds)


def test_every_cost_is_a_positive_time(spin):
    for point in spin.points:
        assert np.isfinite(point.cost).all()
        assert (point.cost > 0).all()


@pytest.mark.extended
def test_engine_that_declines_is_left_out_with_the_reason():
    short = load("drop-ball").model_copy(update={"duration": 0.6})
    found = tradeoff(short, ["mujoco", "mujoco[integrator=rk4]"])
    assert "RK4 the adapter's one-step damper" in found.left_out["mujoco[integrator=rk4]"]
    assert {point.engine for point in found.points} == {"mujoco"}
    assert METRICS[found.metric].unit == "1"


def test_unknown_metric_and_declining_engines_are_errors():
    with pytest.raises(DropspinError, match="metric 'restitution_error' is unknown"):
        tradeoff(SPIN, ["mujoco"], metric="restitution_error")
    with pytest.raises(DropspinError, match=r"compared in drop-ball: mujoco\[integrator=rk4\]: with RK4 the adapter's one-step damper"):
        tradeoff(load("drop-ball"), ["mujoco[integrator=rk4]"])


@pytest.mark.extended
def test_accuracy_options_are_walked_beside_the_time_step():
    """Each value has a ladder of its own; a shorter inner step is more accurate at the coarsest steps."""
    found = tradeoff("fall-spin", InnerStep(), "position_error", budget=0.02)
    errors_at_coarsest = {ladder.engine: ladder.steps[0][1] for ladder in found.ladders}
    assert list(errors_at_coarsest) == ["inner-step", *(f"inner-step[inner_step={1 / n!r}]" for n in (240, 480))]
    assert errors_at_coarsest["inner-step"] < 0.5 * errors_at_coarsest[f"inner-step[inner_step={1 / 240!r}]"]


def _pages(size):
    """Memory of the system's own, all of it in use; what malloc takes beyond it depends on what this process did before."""
    memory = np.frombuffer(mmap.mmap(-1, size), np.uint8)
    memory[:] = 1
    return memory


class Hoarding(BatchSimulation):
    """Worlds that do not move, each with 20 kB, and twice as much in every step."""

    def __init__(self, members):
        self._states = np.array([member.initial_state for member in members])
        self._kept = _pages(20_000 * len(members))

    def advance(self, steps):
        for _ in range(steps):
            _pages(20_000 * len(self._states))

    def states(self):
        return self._states


@pytest.mark.extended
def test_memory_per_world_is_the_peak_of_a_batch():
    """Known: 40 kB, and the states; unknown where the system is not Linux."""
    made = type("Hoarder", (Exact,), {"name": "hoarder", "prepare_batch": lambda self, members, dt: Hoarding(members)})()
    entry = EngineEntry("hoarder", made)
    memory = [costs.memory_per_world(entry, SPIN, 1e-3, worlds) for worlds in (1024, 4096)]
    assert memory == pytest.approx([40_100.0 if costs.PROCESS.exists() else np.nan] * 2, rel=0.03, nan_ok=True)


def test_memory_of_an_engine_without_batches_is_unknown():
    with pytest.raises(Breakdown, match="cannot simulate batches"):
        costs.memory_per_world(EngineEntry("exact", Exact()), SPIN, 1e-3, 1024)


def test_empty_name_of_a_metric_is_refused_before_anything_runs():
    with pytest.raises(DropspinError, match="spin-principal's metric '' is unknown"):
        tradeoff("spin-principal", "no_such_module:Engine", "")


def test_front_that_the_rounds_do_not_decide_is_undecided():
    """A configuration that is ten times as slow in four of nine rounds is on it by the least and the median, and not by the quartile."""
    steady, disturbed = np.full(9, 2.0), np.array([1.0] * 5 + [10.0] * 4)
    found = found_with([CostPoint("steady", 0.1, 1e-3, steady), CostPoint("disturbed", 0.1, 1e-3, disturbed)])
    assert [point.engine for point in found.undecided] == ["disturbed", "steady"]
    assert found_with([CostPoint("steady", 0.1, 1e-3, steady), CostPoint("cheap", 0.1, 1e-3, 0.5 * steady)]).undecided == []
    assert (spread(steady), spread(np.array([1.0, 1.0, 1.0, 3.0])), spread(np.array([1.0, 3.0, 3.0]))) == (1.0, 1.0, 3.0)


class Disturbed(Exact):
    """An engine on a machine whose other load makes every second call ten times as slow, by a clock of its own."""

    name = "disturbed"

    def prepare(self, scene, dt):
        return DisturbedSimulation(scene, dt)


class DisturbedSimulation(ExactSimulation):
    def advance(self, steps):
        super().advance(steps)
        CLOCK["calls"] += 1
        CLOCK["now"] += STEP * steps * (1.0 if CLOCK["calls"] % 2 == 0 else 10.0)


CLOCK = {"now": 0.0, "calls": 0}


def test_cost_of_a_round_is_that_of_the_least_disturbed_timing(monkeypatch):
    """By a clock that only the engine advances; the call, whose time is subtracted, is disturbed too."""
    monkeypatch.setattr("dropspin.comparisons.running.timing.time.perf_counter", lambda: CLOCK["now"])
    assert costs.cost(EngineEntry("disturbed", Disturbed()), SPIN, 0.01) == pytest.approx(STEP / 0.01, rel=1e-9)


def test_load_counts_other_threads_per_processor(monkeypatch, tmp_path):
    (tmp_path / "loadavg").write_text("0.20 0.18 0.12 7/80 11206\n")
    monkeypatch.setattr(costs, "LOAD", tmp_path / "loadavg")
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    assert costs.load() == 3.0
    monkeypatch.setattr(costs, "LOAD", tmp_path / "absent")
    assert np.isnan(costs.load())

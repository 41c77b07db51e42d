"""How often the interval of an asymptotic error is right for engines: part of `make coverage`.

An engine runs a scene in which one parameter is wrong by a known share, and is compared with the exact solution of the right scene. As
dt → 0 its error is that of the exact solution of the wrong scene, measured by the very same metric.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.registry import engine as engine_named
from dropspin.comparisons.judging.convergence import ARTEFACTS, DESYNCHRONISED, JUMPING, SATURATION, Claim, SeriesPoint, convergence
from dropspin.comparisons.measuring.comparison import Comparison, Unresolved
from dropspin.comparisons.measuring.metric import Metric
from dropspin.comparisons.measuring.metrics import metrics_for
from dropspin.comparisons.measuring.tolerances import negligible
from dropspin.comparisons.running.driving import record
from dropspin.comparisons.running.start_phases import start_phases
from dropspin.scenarios import Scenario, Truth, load, truth_for
from support.fault_suite import with_body, with_coefficient, with_gravity, with_restitution
from support.interval_coverage import LARGE, Outcome

Fault = Callable[[float], Callable[[Scenario], Scenario]]

LADDERS = ((4e-3, 2e-3, 1e-3), (2e-3, 1e-3, 5e-4), (5e-3, 2.5e-3, 1e-3), (8e-3, 4e-3, 2e-3, 1e-3, 5e-4))
"""Time steps [s], coarsest first."""
FINER = (8.0, 16.0)
"""The wrong scene's exact solution is measured at the finest step over these, and extrapolated."""
WHOLE = 0.04
"""Durations are a multiple of this [s], and so of every time step."""
RUNS = 120
"""Of each kind of fault; each gives a series for each metric that the fault changes."""
SMALLEST_FAULT, LARGEST_FAULT = 1e-3, 0.1


class Kind(NamedTuple):
    """A kind of fault: the wrong scene as a function of the factor on the parameter, and the scenes and engines in which it is planted.

    Without the fault each of these engines converges to the exact solution of each of the scenes beside it.
    """

    title: str
    fault: Fault
    places: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]


def with_moments(factor: float) -> Callable[[Scenario], Scenario]:
    """Moments of inertia wrong by different shares about two axes; by the same share the body would turn as it should."""
    return with_body(moments=lambda moments: moments * np.array([factor, 1.0, 0.5 + 0.5 * factor]))


FLIGHT = ("mujoco", "pybullet")
BOUNCES = (("drop-ball", "drop-ball-dull", "drop-box-flat"), ("wang",))
KINDS = (
    Kind("restitution", lambda factor: with_restitution(lambda e: factor * e), (BOUNCES,)),
    Kind("gravity", lambda factor: with_gravity(factor * np.eye(3)), (BOUNCES, (("fall-spin", "fall-damped"), ("wang", *FLIGHT)))),
    Kind("inertia", with_moments, ((("spin-asymmetric", "spin-damped", "spin-coin"), FLIGHT),)),
    Kind("friction", with_coefficient, ((("slide-box",), ("wang[law=coulomb]", "pybullet")), (("turn-box-rough",), ("pybullet",)))),
)


def outcomes(title: str, runs: int) -> list[tuple[str, Outcome]]:
    """What a study of convergence says of each metric in random runs with a kind of fault; each with a description."""
    kind = next(kind for kind in KINDS if kind.title == title)
    rng, found = np.random.default_rng([*title.encode()]), []
    for _ in range(runs):
        scenes, engines = kind.places[rng.integers(len(kind.places))]
        scene = load(str(rng.choice(scenes)))
        scene = scene.model_copy(update={"duration": WHOLE * math.floor(min(scene.duration, rng.uniform(0.5, 3.0)) / WHOLE)})
        size = math.exp(rng.uniform(math.log(SMALLEST_FAULT), math.log(LARGEST_FAULT)))
        change = kind.fault(1.0 + float(rng.choice([-1.0, 1.0])) * size)
        found += series_of(scene, change, engine_named(str(rng.choice(engines))), LADDERS[rng.integers(len(LADDERS))])
    return found


def series_of(
    scene: Scenario, change: Callable[[Scenario], Scenario], engine: Engine, dts: tuple[float, ...]
) -> Iterator[tuple[str, Outcome]]:
    """One outcome for each metric in which the fault has an effect that matters."""
    truth = truth_for(scene)
    assert truth is not None
    measured = {dt: _cases(scene, truth, change, engine, dt) for dt in dts}
    limits = [_exact(scene, truth, change(scene), dts[-1] / finer) for finer in FINER]
    for metric in metrics_for(scene, truth):
        # The gap of a sampled exact motion is where the impact falls within a step, and has no limit.
        if metric.name in JUMPING | ARTEFACTS | {"contact_gap"}:
            continue
        try:
            points = [
                SeriesPoint(dt, scene.steps(dt), metric.average(cases), metric.average_components(cases), 0.0)
                for dt, cases in measured.items()
            ]
            coarse, fine = (np.atleast_1d(metric.measure(limit)) for limit in limits)
        except Unresolved:
            continue
        if coarse.shape == fine.shape:
            expected = 2.0 * fine - coarse  # the rest is of first order
            yield from _judged(
                scene, engine, metric, points, _restitution(scene, change) if metric.name == "restitution_error" else expected
            )


def _restitution(scene: Scenario, change: Callable[[Scenario], Scenario]) -> Any:
    """The error of restitution as dt → 0; at steps of any length the sampled motion has another, by where between two the impact falls."""
    right, wrong = scene.floor, change(scene).floor
    assert right is not None
    assert wrong is not None
    return np.array([wrong.restitution - right.restitution])


def _exact(scene: Scenario, truth: Truth, wrong: Scenario, dt: float) -> Comparison:
    """The wrong scene's exact solution at every step, compared with the right scene."""
    times, exact = dt * np.arange(1 + scene.steps(dt), dtype=float), truth_for(wrong)
    assert exact is not None
    return Comparison.with_truth(scene, exact(np.minimum(times, exact.horizon)), truth)


def _cases(scene: Scenario, truth: Truth, change: Callable[[Scenario], Scenario], engine: Engine, dt: float) -> list[Comparison]:
    """The wrong scene's motions from all start phases, compared with the right scene."""
    phases = start_phases(scene, truth, dt)
    return [Comparison.with_truth(phase.scene, record(engine, change(phase.scene), dt).motion, phase.truth) for phase in phases]


def _judged(scene: Scenario, engine: Engine, metric: Metric, points: list[SeriesPoint], expected: Any) -> Iterator[tuple[str, Outcome]]:
    parts = [point.average.parts for point in points]
    if len({part.shape for part in (*parts, expected)}) > 1:
        return  # some flights are compared at some steps only
    worst = np.unravel_index(np.argmax(np.abs(parts[-1])), parts[-1].shape)
    errors, m = np.array([part[worst] for part in parts]), float(expected[worst])
    largest = SATURATION if metric.unit == "rad" else math.inf
    if metric.name == "position_error" and scene.starts_above_floor:
        largest = DESYNCHRONISED * scene.clearance
    if not negligible(scene, metric.unit) < abs(m) < largest:
        return
    found = convergence(scene, Claim(engine.label, engine.order_in(scene), engine.precision), metric, points).budget
    if math.isnan(found.asymptotic_error):
        return
    width = (found.upper - found.lower) / abs(float(errors[-1])) if errors[-1] else math.nan
    is_covered = found.lower <= m <= found.upper
    name = f"{scene.name} {engine.label} {metric.name} {errors} m={m:.6g} [{found.lower:.6g}, {found.upper:.6g}] {found.cause}"
    yield name, Outcome(m, is_covered, found.cause, width, abs(m) > LARGE * abs(float(errors[0])))

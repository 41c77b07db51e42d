"""Balls that bounce without loss gain no energy; one that is thrown again, or lifted, does, and what follows is no part of its toss."""

from dataclasses import replace

import numpy as np
import pytest
from support.log_fits import WANG

from dropspin.comparisons.logs.check import log_check
from dropspin.comparisons.logs.fit import log_fit
from dropspin.comparisons.logs.flights import Flights, flights_of
from dropspin.comparisons.logs.header import Header
from dropspin.comparisons.logs.log import Log, Toss
from dropspin.reports.stories.log_findings import corrections, sentence
from dropspin.scenarios.state import Array

RADIUS, RATE, FALL = 0.05, 148.0, np.array([0.0, -9.81, 0.0])
HEADER = {"data": "balls.npz", "rate": RATE, "floor": {"friction": 0.5, "restitution": 0.5}}


def bouncing(seed: int, restitution: float, impacts: int, noise: tuple[float, float] = (2e-4, 2e-3), duration: float = 1.8) -> Log:
    """Five balls that grip the floor as a superball, which exchanges speed and spin, and stick to it at the last impact."""
    random, tosses, t = np.random.default_rng(seed), [], np.arange(int(duration * RATE)) / RATE
    for number in range(5):
        velocity, spin = np.array([random.uniform(-1.0, 1.0), random.uniform(-0.5, 0.5), 0.0]), random.uniform(-40.0, 40.0)
        x, angle, begin, rows = np.array([0.0, random.uniform(0.5, 1.0), 0.0]), 0.0, 0.0, np.zeros((len(t), 4))
        for left in range(impacts, -1, -1):
            fall = FALL if left else 0.0 * FALL
            lasts = (velocity[1] + np.sqrt(velocity[1] ** 2 + 19.62 * max(x[1] - RADIUS, 0.0))) / 9.81
            since = np.maximum(t - begin, 0.0)[:, np.newaxis]
            rows = np.where(since > 0.0, np.hstack([x + velocity * since + fall * since**2 / 2.0, angle + spin * since]), rows)
            if begin == 0.0:
                rows[0] = [*x, angle]
            x, angle, begin = x + velocity * lasts + fall * lasts**2 / 2.0, angle + spin * lasts, begin + lasts
            grip = -2.0 / 3.5 * (velocity[0] + RADIUS * spin)
            velocity = velocity + FALL * lasts
            velocity, spin = np.array([velocity[0] + grip, -restitution * velocity[1], 0.0]), spin + 2.5 * grip / RADIUS
            if left == 1:
                velocity, spin = 0.0 * velocity, 0.0
        position = rows[:, :3] + noise[0] * random.normal(size=(len(t), 3))
        half = 0.5 * rows[:, 3]
        turned = np.stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)], axis=1)
        turned[:, :3] += 0.5 * noise[1] * random.normal(size=(len(t), 3))
        tosses.append(Toss(str(number), t, position, turned / np.linalg.norm(turned, axis=1, keepdims=True)))
    header = Header.model_validate(HEADER | {"body": {"shape": "sphere", "radius": RADIUS, "mass": 0.3}})
    return Log(header, tuple(tosses), "balls", ())


def found(log: Log) -> Flights:
    flights = flights_of(log, FALL)
    assert flights is not None
    return flights


def joined(first: Toss, second: Toss) -> Toss:
    """Two tosses as one."""
    position, turned = (np.concatenate([getattr(one, name) for one in (first, second)]) for name in ("position", "orientation"))
    return Toss(first.name, np.arange(len(position)) / RATE, position, turned)


@pytest.mark.parametrize("noise", [(1e-6, 1e-6), (5e-3, 2e-3)])
@pytest.mark.parametrize(("restitution", "impacts"), [(1.0, 9), (0.7, 4)])
def test_bouncing_is_no_second_throw(restitution: float, impacts: int, noise: tuple[float, float]) -> None:
    assert found(bouncing(1, restitution, impacts, noise)).moved_again == [None] * 5


@pytest.mark.parametrize("noise", [(2e-4, 2e-3), (5e-3, 2e-3)])
def test_second_throw_is_named_and_no_part_of_the_toss(noise: tuple[float, float]) -> None:
    log, others = (bouncing(seed, 0.3, 3, noise) for seed in (1, 2))
    twice = replace(log, tosses=tuple(map(joined, log.tosses, others.tosses)))
    ends = [len(toss) for toss in log.tosses]
    check = log_check(twice)
    named = [one for one in check.findings if one.kind == "moved again"]
    assert [one.frame for one in named] == ends
    assert sentence(named[0]).startswith(f"Toss 0: from frame {ends[0]} on, the body is moved or thrown again. Remedy: end the toss")
    assert [len(start.toss) for start in check.flights.starts()] == ends


def test_body_that_is_lifted_is_moved_again() -> None:
    log = bouncing(1, 0.3, 3)
    slowly = 0.6 * np.arange(1.0, 101.0) / RATE

    def lifted(toss: Toss) -> Toss:
        height: Array = np.stack([0.0 * slowly, slowly, 0.0 * slowly], axis=1)
        return joined(toss, Toss("", slowly, toss.position[-1] + height, np.tile(toss.orientation[-1], (100, 1))))

    moved = found(replace(log, tosses=tuple(map(lifted, log.tosses)))).moved_again
    assert all(frame is not None and 0 <= frame - len(log.tosses[0]) < 5 for frame in moved), moved


def cut_around_impacts() -> Log:
    """Of each toss 15 frames around the first impact are missing, without times that show it."""
    log, shorter = bouncing(1, 0.5, 3), []
    for toss in log.tosses:
        impact = int(np.argmin(toss.position[:90, 1]))
        kept = np.delete(np.arange(len(toss)), np.arange(impact - 3, impact + 12))
        shorter.append(Toss(toss.name, toss.t[: len(kept)], toss.position[kept], toss.orientation[kept]))
    return replace(log, tosses=tuple(shorter))


def test_frames_that_are_missing_around_an_impact_are_named() -> None:
    log = cut_around_impacts()
    check = log_check(log)
    assert {(one.kind, one.toss) for one in check.findings} == {("leap", toss.name) for toss in log.tosses}
    assert "frames are missing before frame" in sentence(check.findings[0])
    assert corrections("toss.toml", check.findings)[0].startswith("Tosses of which a part is used, as frames are of another throw, missing")


@pytest.mark.extended
def test_fit_of_tosses_of_which_frames_are_missing_is_doubted() -> None:
    whole, cut = (log_fit(log, WANG, jobs=1) for log in (bouncing(1, 0.5, 3), cut_around_impacts()))
    assert (whole.unlike, cut.unlike) == ((), (WANG,))

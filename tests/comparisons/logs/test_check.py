"""Faults planted into sound recordings: each is named, as alternatives where the motion cannot tell them apart."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.tosses import BRICK, CUBE, made

from dropspin.comparisons.logs.check import Check, log_check
from dropspin.comparisons.logs.log import Finding, Log, Toss, load_log
from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.rotations import conjugate, multiply, rotate, unrotate

NOISE = (2e-4, 2e-3)
ON_SIDE = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])


def sound(seed: int = 1, count: int = 10, body: dict[str, Any] = CUBE, **others: Any) -> Log:
    return made(seed, count, NOISE, header={"body": body}, **others).log


def changed(log: Log, **changes: Callable[[Toss], Any]) -> Log:
    """The recording with parts of each toss changed."""
    return replace(log, tosses=tuple(replace(toss, **{name: change(toss) for name, change in changes.items()}) for toss in log.tosses))


def only(check: Check) -> Finding:
    assert len(check.findings) == 1, check.findings
    return check.findings[0]


def cure(finding: Finding) -> dict[str, Any]:
    """The keys of the header that remove the only cause of a finding."""
    assert len(finding.causes) == 1, finding
    return dict(finding.causes[0].keys)


@pytest.mark.sample(1)
@pytest.mark.parametrize("seed", range(4))
def test_a_sound_recording_has_no_finding(seed: int) -> None:
    assert log_check(sound(seed)).findings == ()


@pytest.mark.extended
def test_short_lengths_and_a_low_rate_are_alternatives() -> None:
    # In free flight alone, length / time² is all there is: 0.98 = 0.99².
    for wrong in (changed(sound(), position=lambda toss: 0.98 * toss.position), changed(sound(), t=lambda toss: toss.t / 0.99)):
        found = only(log_check(wrong))
        assert found.kind == "scale"
        shares = {cause.name: cause.share for cause in found.causes}
        assert shares == {"length scale": pytest.approx(-0.02, abs=1.5e-3), "rate": pytest.approx(-0.01, abs=7.5e-4)}


@pytest.mark.extended
@pytest.mark.parametrize(("factor", "unit"), [(1 / 0.0254, "inch"), (1000.0, "mm")])
def test_another_unit_of_length_is_named(factor: float, unit: str) -> None:
    found = only(log_check(changed(sound(), position=lambda toss: factor * toss.position)))
    assert (found.kind, cure(found)) == ("unit", {"length_unit": unit})


@pytest.mark.extended
def test_another_unit_of_time_is_named() -> None:
    found = only(log_check(changed(sound(), t=lambda toss: 1e3 * toss.t)))
    assert (found.kind, cure(found)) == ("unit", {"time_unit": "ms"})


@pytest.mark.extended
def test_another_upward_axis_is_named() -> None:
    lying = changed(
        sound(), position=lambda toss: rotate(ON_SIDE, toss.position), orientation=lambda toss: multiply(ON_SIDE, toss.orientation)
    )
    found = only(log_check(lying))
    assert (found.kind, cure(found)) == ("up", {"up": "z"})


@pytest.mark.extended
@pytest.mark.parametrize(
    ("change", "keys"),
    [
        (lambda toss: np.roll(toss.orientation, 1, axis=1), {"quaternion": "wxyz"}),
        (lambda toss: conjugate(toss.orientation), {"rotation": "world-to-body"}),
    ],
)
def test_another_reading_of_quaternions_is_named_by_the_motion_of_a_brick(change: Callable[[Toss], Any], keys: dict[str, str]) -> None:
    found = only(log_check(changed(sound(count=8, body=BRICK), orientation=change)))
    assert (found.kind, cure(found)) == ("quaternion", keys)


def test_the_order_of_quaternions_of_a_cube_is_named_by_the_faces_it_rests_on() -> None:
    # A cube turns at a constant spin, which it does in any order of the quaternion's numbers.
    cube = load_log("toss-cube")
    some = replace(cube, tosses=cube.tosses[:12])
    wrong = changed(some, orientation=lambda toss: multiply([-np.sqrt(0.5), 0, 0, np.sqrt(0.5)] * np.ones(4), _rolled(toss)))
    check = log_check(wrong)
    [found] = [finding for finding in check.findings if finding.kind == "quaternion"]
    assert cure(found)["quaternion"] == check.corrected.quaternion == "wxyz"


def _rolled(toss: Toss) -> Any:
    return np.roll(multiply(np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]), toss.orientation), 1, axis=1)


@pytest.mark.extended
def test_a_point_beside_the_centre_is_a_pair_of_alternatives() -> None:
    check = log_check(sound(offset=(0.0, 0.005, 0.0), spin=8.0, body=CUBE | {"inertia": "solid"}))
    found = only(check)
    assert found.kind == "centre of mass"
    mass, point = (cause.keys for cause in found.causes)
    assert mass["body.center_of_mass"] == pytest.approx([0.0, -0.005, 0.0], abs=5e-4)
    assert point == {"tracked_point": pytest.approx([0.0, 0.005, 0.0], abs=5e-4)}
    # A solid of uniform density has its mass in the centre, so that the header needs numbers.
    assert mass["body.inertia"] == pytest.approx(check.flights.log.header.body.moments)


@pytest.mark.extended
def test_a_missing_frame_is_named_with_its_place() -> None:
    log = sound(count=8)
    toss = log.tosses[3]
    kept = np.delete(np.arange(len(toss)), 7)
    shorter = replace(toss, t=toss.t[:-1], position=toss.position[kept], orientation=toss.orientation[kept])
    found = only(log_check(replace(log, tosses=(*log.tosses[:3], shorter, *log.tosses[4:]))))
    assert (found.kind, found.toss, found.value, found.frame) == ("frame dropped", "3", 1, 7)


@pytest.mark.extended
def test_uneven_times_are_a_finding_unless_the_body_moved_at_these_times() -> None:
    log = sound()
    rng = np.random.default_rng(5)
    uneven = {toss.name: toss.t + np.concatenate([[0.0], rng.uniform(-1e-3, 1e-3, len(toss) - 1)]) for toss in log.tosses}
    irregular = replace(log, irregularities=(Finding("jitter", 0.008, 1 / 148, "0", 3),))

    def kinds(wrong: Log) -> set[str]:
        return {finding.kind for finding in log_check(wrong).findings}

    def moved(toss: Toss) -> np.ndarray:
        return np.stack([np.interp(uneven[toss.name], toss.t, along) for along in toss.position.T], axis=1)

    assert "jitter" in kinds(changed(irregular, t=lambda toss: uneven[toss.name]))
    assert "jitter" not in kinds(changed(irregular, t=lambda toss: uneven[toss.name], position=moved))


@pytest.mark.extended
def test_a_spin_in_the_body_frame_is_named() -> None:
    with_spin = changed(sound(), angular_velocity=lambda toss: np.zeros((len(toss), 3)))
    check = log_check(with_spin)
    rotors = {rotor.flight.toss.name: rotor for rotor in check.flights.rotations}
    given = changed(with_spin, angular_velocity=lambda toss: unrotate(toss.orientation, rotors[toss.name](toss.t)[1]))
    assert cure(only(log_check(given))) == {"spin_frame": "body"}


@pytest.mark.extended
def test_the_shipped_cube_has_short_lengths_and_an_eccentric_mass() -> None:
    # Intervals of an independent evaluation of the same tosses: gravity -9.623 to -9.579 m/s², centre of mass 4.4 to 6.7 mm along z.
    check = log_check(load_log("toss-cube"))
    kinds = {finding.kind: finding for finding in check.findings}
    values = {value.name: value for value in check.values}
    assert 9.579 < values["gravity"].value < 9.623
    assert 0.00438 < values["centre of mass, z"].value < 0.00673
    assert values["centre of mass, x"].low < 0.0 < values["centre of mass, x"].high
    assert cure(kinds["scale"]) == {"length_scale": 0.978}
    assert list(cure(kinds["centre of mass"])) == ["body.center_of_mass"]


def test_a_recording_without_free_flight_is_refused() -> None:
    still = changed(sound(count=2), position=lambda toss: 0.0 * toss.position)
    with pytest.raises(DropspinError, match="free flight"):
        log_check(still)

"""Faults planted into sound recordings: each is named, as alternatives where the motion cannot tell them apart."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.tosses import BRICK, CUBE, Made, made, turned

from dropspin.comparisons.logs import check as checks
from dropspin.comparisons.logs import falling
from dropspin.comparisons.logs.check import CENTRES, RATIOS, Check, log_check
from dropspin.comparisons.logs.continued_tosses import flights_in
from dropspin.comparisons.logs.flights import Flights, flights_of, heights
from dropspin.comparisons.logs.grids import problem_of
from dropspin.comparisons.logs.header import UPRIGHT, Header
from dropspin.comparisons.logs.log import Finding, Log, Toss, load_log
from dropspin.comparisons.logs.noise import Noise, Regression
from dropspin.comparisons.logs.recording_faults import _in_mid_air, of_frames, of_rates, ratios_of_rates
from dropspin.reports.stories.log_findings import corrections, sentence
from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.rotations import about, conjugate, multiply, rotate, unrotate
from dropspin.scenarios.state import UP, Array
from dropspin.scenarios.validation import validated

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
        assert shares.pop("length scale") == pytest.approx(-0.02, abs=1.5e-3)
        assert shares.pop("rate") == pytest.approx(-0.01, abs=7.5e-4)
        assert list(shares) == ["local gravity"]


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


def with_rests(log: Log) -> Log:
    """The recording whose tosses end at rest, each on a face, turned by any angle about the vertical."""
    random, rows = np.random.default_rng(5), 12

    def face(toss: Toss) -> np.ndarray:
        return np.array(([0.0, 0.0, 0.0, 1.0], [0.5, 0.5, 0.5, 0.5], ON_SIDE)[int(toss.name) % 3])

    def height(toss: Toss) -> np.ndarray:
        return np.abs(unrotate(face(toss), UP)) @ np.array(log.header.body.half_extents) * UP

    def still(toss: Toss) -> np.ndarray:
        yaw = random.uniform(0.0, np.pi)
        rest = multiply(np.array([0.0, np.sin(yaw), 0.0, np.cos(yaw)]), face(toss))
        return np.concatenate([toss.orientation, turned(random.normal(size=(rows, 3)) * NOISE[1], np.tile(rest, (rows, 1)))])

    return changed(
        log,
        t=lambda toss: np.arange(len(toss) + rows) / 148.0,
        position=lambda toss: np.concatenate([toss.position, height(toss) + random.normal(size=(rows, 3)) * NOISE[0]]),
        orientation=still,
    )


ORDER, DIRECTION = {"quaternion": "wxyz"}, {"rotation": "world-to-body"}


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("change", "causes"),
    [
        (conjugate, [DIRECTION]),
        (lambda orientation: np.roll(conjugate(orientation), 1, axis=1), [ORDER | DIRECTION, {"body.half_extents": [0.07, 0.05, 0.04]}]),
    ],
)
def test_the_reading_that_fits_best_is_named_and_all_that_fit_as_well(change: Callable[..., Any], causes: list[dict[str, Any]]) -> None:
    # Rows of quaternions that are the inverse ones lie on faces in the order wxyz too; read [w, x, y, z], inverse ones exchange two edges.
    body = {"shape": "box", "half_extents": [0.04, 0.05, 0.07], "mass": 0.4}
    log = with_rests(sound(count=6, body=body))
    found = only(log_check(changed(log, orientation=lambda toss: change(toss.orientation))))
    assert (found.kind, [cause.keys for cause in found.causes]) == ("quaternion", causes)


def test_the_flight_of_the_tracked_point_decides_between_readings_in_which_a_cylinder_turns_alike() -> None:
    cylinder = {"shape": "cylinder", "radius": 0.03, "half_length": 0.06, "mass": 0.4}
    header = {"body": cylinder, "tracked_point": [0.02, 0.03, 0.01]}
    log = made(2, 6, NOISE, header=header, offset=(0.02, 0.03, 0.01), spin=10.0, durations=(0.2, 0.3)).log
    check = log_check(changed(log, orientation=lambda toss: conjugate(toss.orientation)))
    [found] = [one for one in check.findings if one.kind == "quaternion"]
    assert [cause.keys for cause in found.causes] == [DIRECTION]


def with_body(log: Log, body: dict[str, Any]) -> Log:
    """The recording with another body in its header."""
    return replace(log, header=validated(Header, "header", log.header.model_dump() | {"body": body}))


def test_edges_in_another_order_are_named_by_the_motion_of_a_brick() -> None:
    edges = [0.04, 0.05, 0.07]
    body = {"shape": "box", "half_extents": edges, "mass": 0.4}
    log = sound(count=6, body=body)
    check = log_check(with_body(log, body | {"half_extents": [0.07, 0.04, 0.05]}))
    assert (only(check).kind, cure(only(check))) == ("body axes", {"body.half_extents": edges})
    assert check.corrected == log.header


def test_wrong_scale_of_lengths_moves_no_tracked_point() -> None:
    """Recorded 2 % short, 62 mm between the tracked point and the centre of mass are 61."""
    point = (0.03, 0.02, -0.05)
    log = made(1, 5, (2e-5, 2e-4), offset=point, spin=10.0, header={"tracked_point": point}).log
    assert [finding.kind for finding in log_check(changed(log, position=lambda toss: 0.98 * toss.position)).findings] == ["scale"]


@pytest.mark.extended
def test_two_edges_that_are_exchanged_and_other_moments_are_alternatives() -> None:
    body = {"shape": "box", "half_extents": [0.04, 0.05, 0.07], "mass": 0.4}
    check = log_check(with_body(sound(count=6, body=body), body | {"half_extents": [0.05, 0.04, 0.07]}))
    for found in check.findings:
        assert found.kind.startswith("inertia")
        assert [cause.name for cause in found.causes] == ["body axes", "other moments"]
        assert found.causes[0].keys == {"body.half_extents": [0.04, 0.05, 0.07]}
    assert check.findings


def test_a_constant_spin_of_a_brick_is_an_alternative_to_equal_moments() -> None:
    log = made(2, 8, NOISE, spin=8.0, header={"body": CUBE}).log  # a cube turns so
    check = log_check(replace(log, header=made(1, 0).log.header))
    assert {found.kind for found in check.findings} == {"inertia, x", "inertia, z"}
    for found in check.findings:
        assert [cause.name for cause in found.causes] == ["constant spin", "other moments"]
    assert check.corrected == check.flights.log.header


@pytest.mark.extended
def test_a_bar_along_another_axis_than_a_cylinder_is_named_without_a_key() -> None:
    body = {"shape": "cylinder", "radius": 0.05, "half_length": 0.2, "mass": 1.0}
    found = only(log_check(with_body(sound(count=6, body=body | {"inertia": [0.01390, 0.01390, 0.00125]}), body)))
    assert (found.kind, cure(found)) == ("body axes", {})


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


@pytest.mark.sample(1)
@pytest.mark.parametrize("count", [9, 1])
def test_missing_frames_are_named_with_their_place(count: int) -> None:
    log = made(1, 5, NOISE, rate=240.0, durations=(0.25, 0.3), header={"body": CUBE}).log
    toss = log.tosses[3]
    kept = np.delete(np.arange(len(toss)), np.arange(30, 30 + count))
    shorter = replace(toss, t=toss.t[:-count], position=toss.position[kept], orientation=toss.orientation[kept])
    found = only(log_check(replace(log, tosses=(*log.tosses[:3], shorter, *log.tosses[4:]))))
    assert (found.kind, found.toss, found.value, found.frame) == ("frame dropped", "3", count, 30)
    assert "wrong: 1. Toss 3: number of frames missing before frame 30" in corrections("toss.toml", [found])[0]


def striking_floor(count: int, **others: Any) -> tuple[Made, Log]:
    """Tosses of a cube, and these with heights at which it strikes the floor."""
    header = {"body": CUBE, "floor": {"restitution": 0.3, "friction": 0.3}}
    recording = made(1, count, NOISE, rate=240.0, durations=(0.3, 0.35), header=header, **others)
    body, tosses = recording.log.header.body, []
    for toss, exact, impact in zip(recording.log.tosses, recording.exact, recording.impacts, strict=True):
        hit = exact(impact)
        toss.position[:, 1] += np.abs(rotate(hit[3:7], np.diag(body.half_extents))[:, 1]).sum() - hit[1]
        tosses.append(toss)
    return recording, replace(recording.log, tosses=tuple(tosses))


def test_a_wrong_point_and_uneven_times_explain_flights_that_seem_to_end_in_mid_air() -> None:
    check = log_check(striking_floor(6, offset=(0.06, 0.02, 0.04))[1])
    assert _in_mid_air(check.flights)
    assert only(check).kind == "centre of mass"
    rng, fact = np.random.default_rng(5), Finding("jitter", 0.006, 1 / 240, "0", 3)
    log = replace(striking_floor(6)[1], irregularities=(fact,))
    uneven = changed(log, t=lambda toss: toss.t + np.concatenate([[0.0], rng.uniform(-1e-3, 1e-3, len(toss) - 1)]))
    uneven.tosses[3].position[12] += [0.03, 0.0, 0.0]
    assert log_check(uneven).findings == (fact,)


def test_a_flight_that_ends_above_the_floor_is_named_unless_most_do() -> None:
    """The body strikes the floor; of one toss all frames from 30 on until after the impact are missing, more than its flight has."""
    recording, sound_one = striking_floor(5)
    tosses = sound_one.tosses
    assert log_check(sound_one).findings == ()
    kept = np.delete(np.arange(len(tosses[3])), np.arange(30, int(recording.impacts[3] * 240.0) + 2))
    cut = replace(replace_rows(tosses[3], kept), t=tosses[3].t[: len(kept)])
    found = only(log_check(replace(sound_one, tosses=(*tosses[:3], cut, tosses[4]))))
    assert (found.kind, found.toss, found.frame) == ("mid-air", "3", 28)
    assert 0.2 < found.value < 0.8
    flights = flights_of(changed(sound_one, position=lambda toss: np.array([0.0, 1.0, 0.0]) + toss.position), np.array([0.0, -9.81, 0.0]))
    assert flights is not None
    assert list(of_frames(flights)) == []


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


@pytest.mark.parametrize("faster", [0.5, 1.5])
def test_a_rate_that_is_far_off_is_measured_and_told_from_lengths_by_the_heights_at_rest(faster: float) -> None:
    # The true rate of the cube, by the lengths of its header, which are 2.2 % short: 148 / √0.978 = 149.7 frames per second.
    cube = load_log("toss-cube")
    some = changed(replace(cube, tosses=cube.tosses[:12], irregularities=()), t=lambda toss: toss.t / faster)
    [found] = [finding for finding in log_check(some).findings if finding.kind == "unit"]
    assert found.value == pytest.approx(9.594 * faster**2, rel=0.01)
    assert [cause.name for cause in found.causes] == ["rate", "local gravity"]
    assert found.causes[0].share == pytest.approx(0.989 * faster - 1.0, abs=0.01)


def test_a_rate_in_the_header_corrects_nothing_where_times_were_recorded() -> None:
    found = only(log_check(replace(changed(sound(), t=lambda toss: 1.03 * toss.t), has_times=True)))
    causes = {cause.name: cause.keys for cause in found.causes}
    assert (found.kind, causes["rate"]) == ("unit", {})


def test_tilted_axes_are_no_wrong_scale() -> None:
    """Gravity along the vertical axis is smaller by 1 - cos."""
    log = sound(count=12, durations=(0.4, 0.6))
    turn = about(np.array([1.0, 0.0, 0.0]), np.radians(5.0))
    wrong = changed(log, position=lambda toss: rotate(turn, toss.position), orientation=lambda toss: multiply(turn, toss.orientation))
    assert [finding.kind for finding in log_check(wrong).findings] == ["tilt"]


@pytest.mark.parametrize("caught", [6, 12])
def test_bodies_that_are_caught_in_mid_air_do_not_move_the_floor(caught: int) -> None:
    """They are still in a hand from frame 30 on, at heights that no floor explains."""
    random = np.random.default_rng(3)

    def position(toss: Toss) -> Array:
        frames = np.arange(len(toss))
        shaken = np.where(frames > 30, NOISE[0], 0.0)[:, np.newaxis] * random.normal(size=toss.position.shape)
        return toss.position[np.minimum(frames, 30)] + shaken if int(toss.name) < caught else toss.position

    def orientation(toss: Toss) -> Array:
        return toss.orientation[np.minimum(np.arange(len(toss)), 30 if int(toss.name) < caught else len(toss))]

    found = log_check(changed(striking_floor(12)[1], position=position, orientation=orientation)).findings
    assert {(one.kind, int(one.toss)) for one in found} == {("mid-air", toss) for toss in range(caught)}


@pytest.mark.parametrize(
    ("lengths", "times", "keys"),
    [
        (1e3, 1e3, [{"length_unit": "mm"}, {"time_unit": "ms"}]),
        (1e3, 8.0, [{"length_unit": "mm"}, {"rate": pytest.approx(148.0, abs=0.5)}]),
        (1.0, 1.811, [{"rate": pytest.approx(148.0, abs=0.5)}]),  # not lengths in feet
    ],
)
def test_heights_at_rest_tell_the_part_of_the_lengths_from_that_of_the_times(lengths: float, times: float, keys: Any) -> None:
    log = with_rests(sound(count=8, body=BRICK))
    wrong = changed(log, t=lambda toss: times * toss.t, position=lambda toss: lengths * toss.position)
    found = [finding for finding in log_check(wrong).findings if finding.kind == "unit"]
    assert [finding.causes[0].keys for finding in found] == keys


@pytest.mark.parametrize("table", [0.01, 0.75])
def test_bodies_on_a_table_whose_height_the_header_lacks_show_no_lengths(table: float) -> None:
    log = changed(with_rests(sound(count=8)), position=lambda toss: 1e3 * (toss.position + table * UP))
    assert cure(only(log_check(log))) == {"length_unit": "mm"}
    late = changed(with_rests(sound(count=8)), position=lambda toss: toss.position + table * UP, t=lambda toss: 1.02 * toss.t)
    assert [cause.name for cause in only(log_check(late)).causes] == ["length scale", "rate", "local gravity"]


FLOOR = {"restitution": 0.5, "friction": 0.2}


@pytest.mark.parametrize(("longer", "higher", "cause"), [(1.25, 0.0, "size of the body"), (1.0, 0.015, "floor")])
def test_a_body_of_another_size_is_told_from_another_floor_by_the_heights_on_several_faces(
    longer: float, higher: float, cause: str
) -> None:
    # Edges that are too long in the header change no flight: the ratios of the moments of inertia are right.
    log = with_rests(made(1, 12, NOISE, header={"body": BRICK, "floor": FLOOR}).log)
    header = log.header.corrected({"body.half_extents": [longer * edge for edge in log.header.body.half_extents]})
    found = only(log_check(replace(changed(log, position=lambda toss: toss.position + higher * UP), header=header)))
    assert (found.kind, [one.name for one in found.causes]) == ("floor", [cause])


def test_bodies_that_rest_on_one_face_show_either_a_size_or_a_floor() -> None:
    log = made(1, 12, NOISE, header={"body": CUBE, "floor": FLOOR}).log
    log = with_rests(replace(log, tosses=tuple(replace(toss, name=f"{3 * number}") for number, toss in enumerate(log.tosses))))
    found = only(log_check(changed(log, position=lambda toss: toss.position + 0.015 * UP)))
    assert [cause.name for cause in found.causes] == ["floor", "size of the body"]
    assert "let the body rest on several faces" in sentence(found)


def test_velocities_of_which_most_are_right_are_a_finding_if_their_ratio_to_the_motion_is_wrong() -> None:
    def velocity(toss: Toss) -> np.ndarray:
        return np.gradient(toss.position, toss.t, axis=0) * (toss.t > 0.08)[:, np.newaxis]

    log = made(1, 8, (0.0, 0.0), header={"body": CUBE}, durations=(0.2, 0.25)).log
    found = [finding for finding in log_check(changed(log, velocity=velocity)).findings if finding.kind == "velocity"]
    assert [finding.causes for finding in found] == [()]
    assert found[0].value > 0.1


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


def test_a_recording_with_short_flights_says_how_many_frames_are_needed() -> None:
    # At 240 frames per second, 12 frames take 50 ms.
    log = made(1, 2, rate=240.0).log
    short = [replace(toss, t=toss.t[:8], position=toss.position[:8], orientation=toss.orientation[:8]) for toss in log.tosses]
    with pytest.raises(DropspinError, match="no toss has 12 frames of free flight"):
        log_check(replace(log, tosses=tuple(short)))
    flights = flights_of(replace(log, tosses=(*log.tosses, replace(short[0], name="short"))), np.array([0.0, -9.81, 0.0]))
    assert flights is not None
    [found] = [finding for finding in of_frames(flights) if finding.kind == "no flight"]
    assert (found.toss, found.expected) == ("short", 12)


def test_a_recording_without_free_flight_is_refused() -> None:
    still = changed(sound(count=2), position=lambda toss: 0.0 * toss.position)
    with pytest.raises(DropspinError, match="free flight"):
        log_check(still)


def test_bodies_that_mostly_rest_are_read_as_the_header_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """Smoothed frames at rest may outnumber the falls with one acceleration, and do not fly; those that fall with gravity do."""
    monkeypatch.setattr(falling, "_acceleration", lambda log, down: np.array([0.0, 0.0, -0.1]))
    assert log_check(with_rests(sound(count=4))).findings == ()


def flying(log: Log, orientation: Callable[[Toss], Any]) -> Log:
    """The first 15 frames of each toss, all of its flight, with other orientations."""
    tosses = [replace(toss, t=toss.t[:15], position=toss.position[:15], orientation=orientation(toss)[:15]) for toss in log.tosses]
    return replace(log, tosses=tuple(tosses))


@pytest.mark.sample(1)
@pytest.mark.parametrize("noise", [(2e-4, 2e-2), (0.0, 0.0)])
def test_bodies_that_do_not_spin_show_neither_their_centre_nor_their_inertia(noise: tuple[float, float]) -> None:
    # Positions depend on the centre of mass only by a constant; the noise of orientations does not move them.
    check = log_check(flying(made(1, 2, noise, spin=0.0).log, lambda toss: toss.orientation))
    assert {value.name for value in check.values if not value.is_identifiable} >= {*CENTRES, *RATIOS}
    assert check.findings == ()


def test_bodies_that_all_spin_about_one_axis_do_not_show_their_centre_along_it() -> None:
    axis, upright = np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.0, 0.0, 1.0])
    noise = np.random.default_rng(3)

    def spun(toss: Toss) -> Any:
        return turned(20.0 * np.outer(toss.t, axis) + 2e-3 * noise.normal(size=(len(toss), 3)), np.tile(upright, (len(toss), 1)))

    flights = flights_of(flying(made(2, 3, NOISE, spin=0.0).log, spun), np.array([0.0, -9.81, 0.0]))
    assert flights is not None
    assert flights.show_offset.tolist() == [False, True, False]


def test_what_is_not_identifiable_gives_neither_a_finding_nor_a_remedy() -> None:
    flights = flights_of(made(3, 2, NOISE).log, np.array([0.0, -9.81, 0.0]))
    assert flights is not None
    # By one regression, I_x / I_y has an interval of ± 0.12, I_z / I_y one of ± 0.02.
    information = np.diag([0.06**-2, 0.01**-2])
    turning = Regression(np.array([-0.5, -0.4]), Noise(1e-3, 0.0), np.ones(1), information[np.newaxis], np.zeros((1, 2)), 1000)
    skewed = replace(flights, turning=turning)
    known = {value.name: value.is_identifiable for value in checks._values(skewed, flights.moving)}
    [found] = checks._of_inertia(skewed, flights.moving, known)
    assert found.kind == "inertia, z"
    before, after = np.array(flights.log.header.body.moments), np.array(cure(found)["body.inertia"])
    np.testing.assert_allclose(after / before, [1.0, 1.0, np.exp(-0.4)])


def with_rates(log: Log, noise: float = 0.0) -> Log:
    """The recording with velocities and spins, which have a noise [m/s, rad/s]."""
    random, flights = np.random.default_rng(4), flights_of(log, np.array([0.0, -9.81, 0.0]))
    assert flights is not None
    tosses = []
    for toss, rotor in zip(log.tosses, flights.rotations, strict=True):
        velocity, spin = np.gradient(toss.position, toss.t, axis=0), rotor(toss.t - toss.t[0])[1]
        noises = noise * random.normal(size=(2, *velocity.shape))
        tosses.append(replace(toss, velocity=velocity + noises[0], angular_velocity=spin + noises[1]))
    return replace(log, tosses=tuple(tosses))


def test_each_error_of_recorded_rates_is_named_and_no_unit_that_does_not_explain_them() -> None:
    log = with_rates(sound(count=4, spin=10.0))
    check = log_check(log)
    assert check.findings == ()
    found = only(log_check(changed(log, velocity=lambda toss: 100.0 * toss.velocity)))
    assert (found.kind, [one.name for one in found.causes]) == ("velocity", ["unit of the velocity"])
    found = only(replace(check, findings=tuple(rates_of(check.flights, velocity=lambda toss: -toss.velocity))))
    assert (found.kind, [one.name for one in found.causes]) == ("velocity", ["sign of the velocity"])

    def causes(change: Callable[[Array], Array]) -> list[tuple[str, ...]]:
        found = list(rates_of(check.flights, angular_velocity=lambda toss: change(unrotate(toss.orientation, toss.angular_velocity))))
        assert {finding.kind for finding in found} == {"spin"}
        assert [dict(cause.keys) for cause in found[0].causes] in ([], [{"spin_frame": "body"}])
        return [tuple(cause.name for cause in finding.causes) for finding in found]

    of_world = list(rates_of(check.flights, angular_velocity=lambda toss: toss.angular_velocity * [-1.0, 1.0, -1.0]))
    assert "the signs of wx and wz are reversed" in sentence(only(replace(check, findings=tuple(of_world))))
    assert causes(lambda spin: spin * [-1.0, -1.0, 1.0]) == [("spin frame",), ("mirror z",)]
    assert causes(np.degrees) == [("spin frame",), ("degrees",)]
    assert causes(lambda spin: -1e3 * spin) == [("spin frame",), ("sign of the spin",), ("unit of the spin",)]
    assert causes(lambda spin: 10.0 * spin[:, [1, 2, 0]]) == [()]


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("keys", "change"),
    [
        ({"time_unit": "ms"}, lambda toss: replace(toss, t=1e-3 * toss.t)),
        ({"length_unit": "mm"}, lambda toss: replace(toss, position=1e-3 * toss.position)),
        ({"quaternion": "wxyz"}, lambda toss: replace(toss, orientation=np.roll(toss.orientation, -1, axis=1))),
    ],
)
def test_header_that_is_wrong_in_a_way_that_lets_no_point_fly_is_corrected(keys: dict[str, Any], change: Callable[[Toss], Toss]) -> None:
    """Turned by wrong quaternions, or in a wrong unit, the point that is tracked beside the centre of mass is not where it was."""
    point = (0.03, 0.02, -0.05)
    log = made(1, 5, NOISE, offset=point, spin=10.0, header={"tracked_point": point}).log
    header = log.header.model_copy(update={"rate": None})
    wrong = replace(log, header=header.model_copy(update=keys), tosses=tuple(map(change, log.tosses)))
    assert log_check(wrong).corrected == header


def test_another_reading_is_not_searched_for_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two readings of which each is the best of the other would be tried in turn without end."""
    monkeypatch.setattr(checks, "flights_in_any_units", lambda *given: (_ for _ in ()).throw(DropspinError("no toss has a flight")))
    log = sound(count=4)
    wrong = replace(log, header=log.header.model_copy(update={"length_unit": "mm"}))
    assert log_check(changed(wrong, position=lambda toss: 1e-3 * toss.position)).corrected == log.header


def rates_of(flights: Flights, **changes: Callable[[Toss], Any]) -> Iterator[Finding]:
    """The findings of rates in flights of tosses of which other parts are changed."""
    return of_rates(with_other_parts(flights, **changes))


def with_other_parts(flights: Flights, **changes: Callable[[Toss], Any]) -> Flights:
    """The same flights, of tosses of which other parts are changed."""
    log = changed(flights.log, **changes)
    each = zip(flights.rotations, log.tosses, strict=True)
    moved = [replace(rotor, flight=replace(rotor.flight, toss=toss)) for rotor, toss in each]
    return replace(flights, log=log, rotations=tuple(moved))


@pytest.mark.parametrize("up", ["y", "z", "-x"])
def test_rates_in_the_frame_of_the_body_are_named_whatever_axis_is_up(up: str) -> None:
    """And whether the centre of mass moves with the recorded velocities or, as here, another point."""
    point, upright = (0.04, 0.01, -0.02), np.array(UPRIGHT[up])
    log = with_rates(made(1, 4, (1e-4, 1e-3), spin=10.0, offset=point, header={"tracked_point": point, "up": up}).log)
    flights = flights_of(log, np.array([0.0, -9.81, 0.0]))
    assert flights is not None

    def found(frame: str, **changes: Callable[[Toss], Any]) -> list[tuple[str, list[str]]]:
        framed = replace(log, header=log.header.model_copy(update={"spin_frame": frame}))
        findings = rates_of(replace(flights, log=framed), **changes)
        return [(finding.kind, [cause.name for cause in finding.causes]) for finding in findings]

    assert found("world") == []
    in_body = {
        name: lambda toss, name=name: rotate(upright, unrotate(toss.orientation, getattr(toss, name)))
        for name in ("angular_velocity", "velocity")
    }
    assert found("world", **in_body) == [("spin", ["spin frame"]), ("velocity", ["velocity frame"])]
    in_feet = found("world", velocity=lambda toss: toss.velocity / 0.3048)
    assert in_feet == [("velocity", ["unit of the velocity"])]
    in_world = {"angular_velocity": lambda toss: rotate(toss.orientation, unrotate(upright, toss.angular_velocity))}
    assert found("body", **in_world) == [("spin", ["spin frame"])]


def test_orientations_of_a_body_that_turns_too_fast_for_the_frames_are_no_other_reading() -> None:
    random = np.random.default_rng(6)
    log = changed(with_rates(sound(count=4)), orientation=lambda toss: turned(1.5 * random.normal(size=(len(toss), 3)), toss.orientation))
    assert [finding.kind for finding in log_check(log).findings] == ["rotation"]


def test_ratios_of_recorded_rates_to_those_of_the_motion_are_values() -> None:
    """Differences give the velocity of a parabola exactly, except in its first row."""
    flights = flights_of(with_rates(made(3, 6, spin=8.0, durations=(0.3, 0.4)).log), np.array([0.0, -9.81, 0.0]))
    assert flights is not None
    changes = {"velocity": lambda toss: 1.06 * toss.velocity, "angular_velocity": lambda toss: 0.95 * toss.angular_velocity}
    (_, spin, _, _), (_, velocity, low, high) = ratios_of_rates(with_other_parts(flights, **changes))
    assert spin == pytest.approx(0.95, rel=1e-6)
    assert velocity == pytest.approx(1.06, rel=0.01)
    assert low <= velocity <= high < low + 0.01
    assert list(rates_of(flights, **changes)) == []


@pytest.mark.sample(1)
@pytest.mark.parametrize("spin", [0.0, 0.2])
def test_spins_that_differ_by_their_noise_agree(spin: float) -> None:
    """Of bodies that do not turn, or hardly, the noise is as large as the spin, or infinitely larger."""
    assert log_check(with_rates(sound(spin=spin), noise=0.1)).findings == ()


def test_spins_of_exactly_zero_agree_with_quaternions_that_do_not_turn() -> None:
    log = changed(made(1, 5, spin=0.0, header={"body": CUBE}).log, angular_velocity=lambda toss: np.zeros_like(toss.position))
    assert not [found for found in log_check(log).findings if found.kind == "spin"]
    found = only(log_check(changed(log, angular_velocity=lambda toss: np.ones_like(toss.position))))
    assert (found.kind, found.causes) == ("spin", ())


def test_a_short_sound_recording_has_no_finding() -> None:
    """Twelve frames of one flight do not determine gravity within 20 %."""
    for seed in range(6):
        log = sound(seed, count=1)
        assert log_check(replace(log, tosses=tuple(replace_rows(toss, slice(0, 12)) for toss in log.tosses))).findings == ()


def replace_rows(toss: Toss, rows: Any) -> Toss:
    return replace(toss, t=toss.t[rows], position=toss.position[rows], orientation=toss.orientation[rows])


@pytest.mark.parametrize(("rate", "kind"), [(0.1, "drag"), (-0.05, "no drag")])
def test_drag_is_no_error_of_lengths(rate: float, kind: str) -> None:
    """A rate of 0.1 1/s changes the fall as a gravity that is 1 to 2 % smaller does; the interval contains the true one."""
    log = made(3, 12, (1e-4, 1e-3), durations=(0.4, 0.6), header={"body": CUBE}).log
    slowed = changed(log, position=lambda toss: toss.position - rate * _twice_integrated(toss))
    check = log_check(slowed)
    assert {found.kind for found in check.findings} == {kind}
    gravity = next(value for value in check.values if value.name == "gravity")
    assert abs(gravity.value - 9.81) > 0.5 * abs(rate)
    assert gravity.low < 9.81 < gravity.high


def _twice_integrated(toss: Toss) -> Any:
    """The integral of the path from the start on, which is that of the velocity twice [m s]."""
    way = toss.position - toss.position[0]
    steps = 0.5 * (way[1:] + way[:-1]) * np.diff(toss.t)[:, np.newaxis]
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


@pytest.mark.parametrize("decay", [0.3, -0.1])
def test_a_spin_that_decays_or_grows_is_measured(decay: float) -> None:
    """In closed form: a cube turns about a fixed axis by ω (1 - exp(-kt)) / k."""
    random = np.random.default_rng(7)

    def slowed(toss: Toss) -> Any:
        turns = np.outer(-np.expm1(-decay * toss.t) / decay, random.normal(size=3) * 8.0) + NOISE[1] * random.normal(size=(len(toss), 3))
        return turned(turns, np.tile([0.0, 0.0, 0.0, 1.0], (len(toss), 1)))

    check = log_check(changed(made(1, 8, NOISE, durations=(0.3, 0.4), header={"body": CUBE}).log, orientation=slowed))
    [value] = [value for value in check.values if value.name == "decay of the spin"]
    assert only(check).kind == "spin decay"
    assert value.low < decay < value.high
    assert value.half_width < 0.02


def test_a_bad_frame_is_named_and_not_a_late_flight() -> None:
    log = made(1, 10, NOISE, durations=(0.3, 0.4), header={"body": CUBE}).log
    bad = log.tosses[3].position.copy()
    bad[12] += [0.02, 0.0, 0.0]
    tosses = (*log.tosses[:3], replace(log.tosses[3], position=bad), *log.tosses[4:])
    found = only(log_check(replace(log, tosses=tosses)))
    assert (found.kind, found.toss, found.frame, found.value) == ("bad frame", log.tosses[3].name, 12, 1.0)


def test_frozen_rows_are_the_only_finding_of_a_toss_whose_flight_they_cut() -> None:
    log = made(1, 10, NOISE, durations=(0.3, 0.4), header={"body": CUBE}).log
    frozen = replace(replace_rows(log.tosses[3], np.maximum(np.arange(len(log.tosses[3])), 20)), t=log.tosses[3].t)
    fact = Finding("repeated", 20.0, 0.0, frozen.name, 1)
    found = only(log_check(replace(log, tosses=(*log.tosses[:3], frozen, *log.tosses[4:]), irregularities=(fact,))))
    assert found == fact
    assert sentence(found).startswith("Toss 3, from frame 1 on: number of rows that repeat the previous row while the body moves: 20.")


def test_bodies_that_fly_below_the_floor_are_a_finding_without_rests() -> None:
    log = made(1, 5, NOISE, header={"body": CUBE, "floor": {"restitution": 0.3, "friction": 0.3}}).log
    found = only(log_check(changed(log, position=lambda toss: toss.position - [0.0, 3.0, 0.0])))
    assert found.kind == "below"
    assert 1.5 < found.value < 2.5


@pytest.mark.parametrize(("depth", "kinds"), [(0.0, []), (0.06, ["end below"])])
def test_flights_that_end_below_the_floor_are_a_finding_without_rests(depth: float, kinds: list[str]) -> None:
    """Each toss is moved so that its last frame before the impact has this depth."""
    tossed = made(1, 7, NOISE, durations=(0.2, 0.3), header={"body": CUBE, "floor": {"restitution": 0.3, "friction": 0.3}})
    log, moved = tossed.log, []
    for toss, impact in zip(log.tosses, tossed.impacts, strict=True):
        last = slice(int(impact * 148.0), int(impact * 148.0) + 1)
        height = heights(log.header, toss.position[last], toss.orientation[last])[0]
        moved.append(replace(toss, position=toss.position - [0.0, height + depth, 0.0]))
    findings = log_check(replace(log, tosses=tuple(moved))).findings
    assert [one.kind for one in findings] == kinds
    assert all(0.03 < one.value < 0.07 for one in findings)


def test_noise_in_depth_alone_makes_no_bad_frames() -> None:
    """A single camera measures along its axis ten times less exactly than across it."""
    random = np.random.default_rng(1)
    log = made(1, 12, (2e-4, 5e-3), rate=240.0, durations=(0.3, 0.4), header={"body": CUBE}).log
    depth = np.array([0.0, 0.0, 3e-3])
    wrong = changed(log, position=lambda toss: toss.position + depth * random.normal(size=toss.position.shape))
    assert log_check(wrong).findings == ()


def test_a_filter_may_end_a_flight_early() -> None:
    """A mean of five frames."""

    def smoothed(toss: Toss) -> Array:
        padded = np.pad(toss.position, ((2, 2), (0, 0)), mode="edge")
        return np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0).mean(axis=-1)

    found = log_check(changed(striking_floor(8)[1], position=smoothed)).findings
    assert {one.kind for one in found} <= {"late", "mid-air"}
    assert found
    assert all("filter" in {cause.name for cause in one.causes} for one in found)


def test_a_tracked_point_that_reaches_the_floor_is_found_where_the_body_strikes_it() -> None:
    """That of a ball that is tracked at its lowest point: frames before the impact are above the floor, those of the impact below."""
    ball = {"shape": "sphere", "radius": 0.02, "mass": 0.003}
    header = Header.model_validate({"data": "made", "rate": 240.0, "body": ball, "floor": {"restitution": 0.8, "friction": 0.3}})
    t, random = np.arange(130) / 240.0, np.random.default_rng(1)
    tosses = []
    for number in range(8):
        landing = 0.3 + 0.02 * random.uniform()
        height = np.where(t < landing, 4.905 * (landing**2 - t**2), (t - landing) * (0.8 * 9.81 * landing - 4.905 * (t - landing)))
        position = np.stack([0.2 * t, height, 0.0 * t], axis=1) + 2e-4 * random.normal(size=(len(t), 3))
        tosses.append(Toss(str(number), t, position, np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1))))
    found = only(log_check(Log(header, tuple(tosses), "ball", ())))
    assert found.kind == "end below"
    assert 0.01 < found.value < 0.02
    right = changed(Log(header, tuple(tosses), "ball", ()), position=lambda toss: toss.position + 0.02 * UP)
    assert log_check(right).findings == ()
    # Orientations that never change are not compared: there are three numbers in each of 8 frames.
    assert len(problem_of(flights_in(right), 8, 4).variances) == 24


@pytest.mark.sample(1)
@pytest.mark.parametrize(("frame", "angle"), [(0, 0.1), (20, 1.2)])
def test_a_wrong_orientation_is_named_and_changes_no_inertia(frame: int, angle: float) -> None:
    log = made(1, 3, NOISE, durations=(0.3, 0.4)).log

    def one_wrong(toss: Toss) -> Array:
        turns = np.zeros((len(toss), 3))
        turns[frame, 0] = angle * (toss.name == "1")
        return turned(turns, toss.orientation)

    check = log_check(changed(log, orientation=one_wrong))
    assert [(found.kind, found.toss, found.frame) for found in check.findings] == [("misread", "1", frame)]
    np.testing.assert_allclose(check.flights.turning.values, flights_of(log, np.array([0.0, -9.81, 0.0])).turning.values, atol=0.01)


@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_a_body_that_rests_or_slides_does_not_fly(speed: float) -> None:
    """A deceleration along the floor is no gravity."""
    t, random = np.arange(80) / 148.0, np.random.default_rng(2)
    ways = np.stack([speed * t - 1.5 * speed * t**2 / 2.0, np.full(80, CUBE["half_extents"][1]), 0.0 * t], axis=1)
    tosses = [
        Toss(str(number), t, ways + 2e-4 * random.normal(size=ways.shape), np.tile([0.0, 0.0, 0.0, 1.0], (80, 1))) for number in range(5)
    ]
    log = replace(sound(), tosses=tuple(tosses))
    with pytest.raises(DropspinError, match="free flight with one acceleration"):
        log_check(log)


@pytest.mark.parametrize("gravity", [9.78, 9.4])
def test_another_gravity_is_a_cause_beside_the_rate(gravity: float) -> None:
    """Heights at rest show only that the lengths are right."""
    check = log_check(with_rests(made(2, 12, (1e-4, 1e-3), gravity=gravity, durations=(0.4, 0.6), header={"body": CUBE}).log))
    found = only(check)
    assert (found.kind, [cause.name for cause in found.causes[-2:]]) == ("scale", ["rate", "local gravity"])
    assert found.causes[-1].keys == {"gravity": pytest.approx(gravity, abs=0.005)}
    assert check.corrected == check.flights.log.header

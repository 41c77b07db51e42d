"""Twins: made-up engines part at the planted step, by the planted amount, and rounding explains what it should."""

import numpy as np
import pytest
from support import engines as made

from dropspin.comparisons.running.driving import simulate
from dropspin.comparisons.symmetries.twins import twins
from dropspin.scenarios import DropspinError, load

DT = 4e-3
EPS = np.finfo(float).eps


def after(step, share):
    """The exact engine with larger numbers after some step."""
    return made.engine_with("changed", lambda state, time: state * (1.0 + share) if time > (step - 0.5) * DT else state)


def compared(scene, *engines, dt=DT):
    [found] = twins(scene, engines, dt=dt)
    return found


@pytest.mark.extended
def test_findings_do_not_depend_on_the_number_of_jobs():
    engines = [made.Exact(), after(50, 1e-7), "wang"]
    one, two = (twins(["fall-tilted", "spin-asymmetric", "drop-ball"], engines, dt=DT, jobs=jobs) for jobs in (1, 2))
    assert [finding.scene for finding in one] == ["fall-tilted"] * 3 + ["spin-asymmetric"] * 3 + ["drop-ball"] * 3
    assert repr(two) == repr(one)  # all digits; NaN equals NaN


def test_equal_engines_never_differ():
    found = compared("spin-asymmetric", made.Exact(), made.engine_with("other", lambda state, time: state))
    assert (found.status, found.first, found.before_contact, found.unexplained) == ("kept", None, 0.0, None)
    assert set(found.beyond.values()) == {None}


def test_one_ulp_is_found_at_its_step():
    found = compared("spin-asymmetric", made.Exact(), after(123, EPS))
    assert (found.status, found.first, found.unexplained) == ("kept", 123, None)
    assert 0.0 < found.before_contact < 1e-15


@pytest.mark.parametrize(("share", "level"), [(1e-8, 1e-9), (1e-5, 1e-6), (1e-2, 1e-3)])
def test_error_is_found_at_its_step_and_its_size(share, level):
    """Of the angular velocity alone."""
    scale = np.array([1.0] * 10 + [1.0 + share] * 3)
    other = made.engine_with("faster", lambda state, time: state * scale if time > 122.5 * DT else state)
    found = compared("spin-principal", made.Exact(), other)
    assert found.beyond[level] == found.unexplained == found.first == 123
    assert found.before_contact == pytest.approx(share, rel=1e-9)


def test_other_algorithm_from_the_first_contact_on():
    """A bounce with another coefficient of restitution: not a bit differs before it."""
    exact = simulate("drop-ball", made.Exact(), DT)
    contact = int(np.argmax(exact.velocity[:, 1] > 0.0))
    scale = np.array([1.0] * 7 + [1.0 + 1e-4] * 3 + [1.0] * 3)
    other = made.engine_with("bouncier", lambda state, time: state * scale if time > (contact - 0.5) * DT else state)
    found = compared("drop-ball", made.Exact(), other)
    assert found.status == "lost"
    assert found.first == found.unexplained == contact
    assert found.before_contact == 0.0
    assert found.after_contact > 1e-5


def test_earlier_of_both_contacts_divides_the_motion():
    """A state with the velocity after a bounce, four steps before the other engine's contact; all other states are equal."""
    exact = simulate("drop-ball", made.Exact(), DT)
    early = int(np.argmax(exact.velocity[:, 1] > 0.0)) - 4
    scale = np.array([1.0] * 7 + [-0.5] * 3 + [1.0] * 3)
    other = made.engine_with("early", lambda state, time: state * scale if abs(time - early * DT) < 0.5 * DT else state)
    found = compared("drop-ball", made.Exact(), other)
    assert (found.first, found.before_contact) == (early, 0.0)
    assert found.after_contact == pytest.approx(1.5 * abs(exact.velocity[early, 1]) / np.abs(exact.velocity).max())


class Chaotic(made.Exact):
    """Moves along x by a chaotic map, x → 1 - 2 x², which doubles errors in each step; it begins with one."""

    name = "chaotic"
    error = 0.0

    def prepare(self, scene, dt):
        value = [scene.initial_state[0] * (1.0 + type(self).error)]

        def distort(state, time):
            while len(value) <= round(time / dt):
                value.append(1.0 - 2.0 * value[-1] ** 2)  # the logistic map on [-1, 1]: errors double
            state = state.copy()
            state[0] = value[round(time / dt)]
            return state

        return made.ExactSimulation(scene, dt, distort)


def test_growth_of_one_ulp_in_a_chaotic_motion_is_rounding():
    """The same map; and one that differs by 1e-6, which the same growth does not explain."""
    scene = load("spin-asymmetric")
    start = scene.initial_state
    start[0] = 0.3
    scene = scene.starting_at(start)
    other = type("Other", (Chaotic,), {"name": "other", "error": EPS})
    wrong = type("Wrong", (Chaotic,), {"name": "wrong", "error": 1e-6})
    same = compared(scene, Chaotic(), other(), dt=0.03)
    assert (same.status, same.unexplained, same.first) == ("rounding", None, 1)
    assert same.before_contact > 1.0
    steps = [same.beyond[level] for level in sorted(same.beyond)]
    assert steps == sorted(steps)
    assert steps[1] - steps[0] == pytest.approx(np.log2(1e3), abs=3.0)  # errors double in each step
    differs = compared(scene, Chaotic(), wrong(), dt=0.03)
    assert (differs.status, differs.unexplained) == ("lost", 1)


class Single(made.Exact):
    """Rounds each state to single precision."""

    name = "single"
    precision = np.float32
    distort = staticmethod(lambda state, time: state.astype(np.float32).astype(float))


def test_single_precision_explains_a_twin_in_single_precision_only():
    found = compared("spin-asymmetric", made.Exact(), Single())
    assert (found.status, found.first, found.unexplained) == ("kept", 1, None)
    assert 1e-8 < found.before_contact < 1e-6
    undeclared = type("Undeclared", (Single,), {"name": "undeclared", "precision": np.float64})()
    assert compared("spin-asymmetric", made.Exact(), undeclared).unexplained == 1


def test_engine_without_a_motion_costs_its_pairs():
    found = twins("spin-asymmetric", [made.Exact(), made.Crashing(), Single()], dt=DT)
    assert [one.status for one in found] == ["not run", "kept", "not run"]
    assert "no such thing as a floor" in found[0].reason


def test_one_engine_is_refused():
    with pytest.raises(DropspinError, match="got 1 engine; name at least two"):
        twins("spin-asymmetric", ["mujoco"])

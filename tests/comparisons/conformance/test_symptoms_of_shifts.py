"""What `conform` says of a shifted centre of mass, of another gravity, of late rows, and of faults that other probes contradict."""

import numpy as np
import pytest
from support import engines as made
from support.bouncing import Bouncing, coulomb, with_restitution

from dropspin.comparisons.conformance.checks import run_check
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.scenarios.rotations import cross, rotate
from dropspin.scenarios.variations import changed


def failed(engine, *checks):
    """The message of each check that fails."""
    found = [run_check(EngineEntry(engine.label, engine), check) for check in checks]
    return {one.check: one.message for one in found if one.outcome == "failed"}


class Unbalanced(made.Exact):
    """The centre of mass is beside that of the shape."""

    centre = (0.01, 0.0, 0.0)

    def prepare(self, scene, dt):
        tensor = scene.body.inertia_tensor.tolist()
        other = changed(scene, body={"center_of_mass": self.centre, "inertia": tensor})
        return super().prepare(other.starting_at(scene.initial_state), dt)


def test_ball_that_a_floor_without_friction_turns_has_its_centre_of_mass_elsewhere():
    """Its restitution is right, although the speed of the centre of mass after an impact is not."""
    found = failed(Unbalanced(), "bouncing ball", "later impacts")
    message = "a floor without friction turns a ball: the impulse acts 0.01 m beside the centre of mass, which is the centre of the ball"
    assert found["later impacts"] == message
    assert found["bouncing ball"].startswith(f"{message}; position is off by ")


def test_restitution_of_a_body_that_touches_at_another_height_is_not_stated():
    """The speeds at the exact contact point would give 0.665, but another point touches."""
    engine = Unbalanced()
    engine.centre = (0.02, 0.01, -0.015)
    [message] = failed(engine, "corner").values()
    assert message.startswith("the first contact begins at a height of 0.2286 m instead of 0.208056 (9.9 % too high); position is off by ")


def test_friction_of_half_the_size_is_no_mistake_in_the_equations():
    """The probe of the floor names it; in an impact it could be that of a squared speed."""
    engine = Bouncing(title="halved", law=lambda *impact: coulomb(*impact, factor=0.5))
    found = failed(engine, "impacts", "slippery floor")
    assert set(found) == {"slippery floor"}
    assert found["slippery floor"].startswith("friction appears to be halved")


def test_fault_that_several_other_probes_contradict_is_not_named():
    """The root of the restitution is near the mean of 0.6 and 1 in one probe, and neither that nor right in two others."""
    found = failed(Bouncing(title="root", law=with_restitution(lambda e, speed: e**0.5)), "slow ball", "dull ball")
    assert all(message.startswith("restitution is 0.") for message in found.values())


class OtherGravity(made.Exact):
    """Has another gravity than the scene's."""

    def prepare(self, scene, dt):
        changed = None if scene.gravity is None else type(scene.gravity)(acceleration=self.of(scene.acceleration).tolist())
        return super().prepare(scene.model_copy(update={"gravity": changed}), dt)


@pytest.mark.parametrize(
    ("of", "message"),
    [
        (lambda g: 2.0 * g, "gravity acts twice"),
        (lambda g: np.array([0.0, -9.81, 0.0]), "gravity is 9.81 m/s² along -y for every scene that has gravity"),
        (lambda g: g * [0.0, 1.0, 0.0], "gravity acts along y only; it is a vector"),
    ],
)
def test_other_gravity_is_named_and_no_wrong_time(of, message):
    """The velocity is ever earlier than in the exact fall, not by a number of steps."""
    engine = OtherGravity()
    engine.of = of
    assert failed(engine, "time", "falling") == {"falling": message}


def test_states_of_a_point_beside_the_centre_of_mass_are_named():
    """No damping, although its speed falls as the body turns; about one axis, only the distance from it is known."""
    at = np.array([0.01, -0.02, 0.005])

    class Beside(made.Exact):
        def prepare(self, scene, dt):
            start = scene.initial_state

            def shifted(row, time):
                arm, arm_at_start = rotate(row[3:7], at), rotate(start[3:7], at)
                spins = cross(row[10:], arm) - cross(start[10:], arm_at_start)
                return row + np.concatenate([arm - arm_at_start, np.zeros(4), spins, np.zeros(3)])

            return made.ExactSimulation(scene, dt, shifted)

    found = failed(Beside(), "tumbling", "fast")
    assert found == {
        "tumbling": "the states are those of a point 0.023 m from the centre of mass, at (0.01, -0.02, 0.005) m in the body frame",
        "fast": "the states are those of a point beside the centre of mass, 0.011 m from the axis of rotation",
    }


@pytest.mark.parametrize(("rows", "words"), [(1, "1 step late"), (3, "3 steps late")])
def test_rows_that_are_late_by_some_steps_are_named(rows, words):
    """The orientation stays at its start for some rows, and is then as many steps late."""

    class Late(made.Exact):
        def prepare(self, scene, dt):
            class Delayed(made.ExactSimulation):
                def _states(self, steps):
                    late = super()._states(np.maximum(steps - rows, 0))
                    now = super()._states(steps)
                    now[:, 3:7] = late[:, 3:7]
                    return now

            return Delayed(scene, dt)

    assert failed(Late(), "time") == {"time": f"the attitude is {words}: it does not belong to the time of its row"}


def test_positions_at_the_middle_of_steps_are_late_and_no_explicit_euler():
    """Both fall as if the velocity were half a step ahead; explicit Euler coasts on time."""

    class Midway(made.Exact):
        def prepare(self, scene, dt):
            class Delayed(made.ExactSimulation):
                def _states(self, steps):
                    now = super()._states(steps)
                    now[:, :3] = super()._states(np.maximum(steps - 0.5, 0.0))[:, :3]
                    return now

            return Delayed(scene, dt)

    late = "position is 0.5 steps late: it does not belong to the time of its row"
    assert failed(Midway(), "time", "velocity lag") == {"time": late, "velocity lag": late}


def test_velocities_that_are_wrong_beside_right_positions_are_no_damping():
    """Too low by 1 % from the first step on, also where the scene has damping."""

    class Slow(made.Exact):
        def prepare(self, scene, dt):
            return made.ExactSimulation(scene, dt, lambda row, time: row * np.repeat([1.0, 0.99], [7, 6]))

    found = failed(Slow(), "coasting", "damped", "turning", "fast")
    speeds = {name: message.split(";")[0] for name, message in found.items()}
    assert speeds["coasting"] == "the final speed is 2.387 m/s instead of 2.41091 (1 % too low), beside positions that are right"
    assert all(message.endswith((" beside positions that are right", " beside attitudes that are right")) for message in speeds.values())
    assert not any("damping" in message or "clamp" in message for message in found.values())

"""Eight usual mistakes of students, in several ways: a check of `conform` names each, and none in right engines."""

import re

import numpy as np
import pytest
from support.students import Solver, Student, student
from support.transcription import UP, quaternion_product, rotation_matrix

from dropspin.comparisons.conformance import motions
from dropspin.comparisons.conformance.checks import run_check
from dropspin.comparisons.conformance.impacts import AT_START, BY_SLIP, IN_NORMAL, NO_TURN, OF_CENTRE, OF_NOTE, POINT_MASS
from dropspin.comparisons.conformance.probes import PROBES
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.running.arguments import EngineEntry

inv = np.linalg.inv
OWN_LAW = "impacts follow the note law, as the engine states"


def found(engine_, *checks):
    """The messages of some checks that did not pass, by check."""
    results = [run_check(EngineEntry(engine_.label, engine_), check) for check in checks]
    return {one.check: one.message for one in results if one.outcome not in ("passed", "declined")}


def decaying(factor, *, before=False):
    """A restitution that is multiplied at each contact, after its use or before it."""

    def wanted_normal(self, u_normal):
        first = factor if before else 1.0
        wanted = -(1.0 + first * self.restitution) * u_normal
        self.restitution *= factor
        return wanted

    return {"wanted_normal": wanted_normal}


def coulomb(sign=1.0, factor=lambda approach, slip: 1.0, *, limited=True):
    """Coulomb's law by the impulse, with a sign, with a factor of the speeds of approach and of slip, and with its limit or without."""

    def impulse(self, K, u, u_normal):
        slip = u - u_normal * UP
        speed = np.linalg.norm(slip)
        along = slip / speed if speed > 0.0 else slip
        normal = -(1.0 + self.restitution) * u_normal / K[1, 1]
        sticking = speed / (along @ K @ along) if speed > 0.0 else 0.0
        sliding = self.floor.coefficient * normal * factor(-u_normal, speed) if self.floor.coefficient > 0.0 else 0.0
        return normal * UP - sign * (min(sliding, sticking) if limited or np.isinf(sliding) else sliding) * along

    return {"impulse": impulse}


def gyroscopic(rotated=True, inverted=True, **methods):
    """Euler's gyroscopic term, which the lecture note leaves out."""

    def advance(self, steps):
        for _ in range(steps):
            R = rotation_matrix(self.q)
            inertia = R @ self.inertia @ R.T if rotated else self.inertia
            rate = np.cross(inertia @ self.w, self.w)
            self.w = self.w + self.dt * ((inv(inertia) if inverted else inertia) @ rate)
            Solver.advance(self, 1)

    return {"advance": advance, **methods}


def position_first(self, steps):
    for _ in range(steps):
        self.move()
        self.v = self.v + self.dt * self.gravity
        if self.floor is not None:
            self.collide()


def unlimited(self, slip, u_normal):
    """`Solver.share` without its upper limit."""
    friction = self.floor.coefficient
    if friction in (0.0, np.inf):
        return float(friction > 0.0)
    return friction * (1.0 + self.restitution) * self.quotient(abs(u_normal), np.linalg.norm(slip))


def turning(self, R):
    return R @ inv(self.inertia) @ R.T


SWAPPED = {"rate": lambda self: quaternion_product(self.q, np.append(self.w, 0.0))}
NOT_ROTATED, NOT_INVERTED = "the inertia is not rotated into the world frame", "the inverse of the inertia is not taken"
SQUARE, AGAINST = "the square of the speed is used in place of the speed", "friction has the wrong sign"
DECAYS, ORDER = "restitution decays from one contact to the next", "the quaternion product is taken in the wrong order"
MISTAKES = {
    "inertia not rotated": (NOT_ROTATED, "corner", {"inverse_inertia": lambda self, R: inv(self.inertia)}),
    "inertia not rotated in K": (NOT_ROTATED, "impacts", {"inverse_in_k": lambda self, R: inv(self.inertia)}),
    "inertia not rotated in a gyroscopic term": (NOT_ROTATED, "tumbling", gyroscopic(rotated=False)),
    "inertia rotated back": ("rotated in the wrong direction", "impacts", {"inverse_inertia": lambda self, R: R.T @ inv(self.inertia) @ R}),
    "inverse not taken": (NOT_INVERTED, "corner", {"inverse_inertia": lambda self, R: R @ self.inertia @ R.T}),
    "inverse not taken in K": (NOT_INVERTED, "impacts", {"inverse_in_k": lambda self, R: R @ self.inertia @ R.T}),
    "restitution of the centre": (
        re.escape(OF_CENTRE),
        "spinning corner",
        {"wanted_normal": lambda self, u: -u - self.restitution * (self.v @ UP)},
    ),
    "no turn": (re.escape(NO_TURN), "impacts", {"inverse_inertia": lambda self, R: np.zeros((3, 3)), "inverse_in_k": turning}),
    "a ball does not turn": (
        re.escape(NO_TURN),
        "slippery floor",
        {"inverse_inertia": lambda self, R: np.zeros((3, 3)), "inverse_in_k": turning},
    ),
    "point mass in K": (re.escape(POINT_MASS), "impacts", {"inverse_in_k": lambda self, R: np.zeros((3, 3))}),
    "neither": (f"{NOT_INVERTED}.*; and {NOT_ROTATED}", "gripping corner", {"inverse_inertia": lambda self, R: self.inertia}),
    "friction along the slip": (AGAINST, "impacts", {"wanted_slip": lambda self, slip, n: self.share(slip, n) * slip}),
    "friction along the slip of a ball": (AGAINST, "slippery floor", coulomb(-1.0)),
    "friction reverses the slip": (AGAINST, "impacts", {"wanted_slip": lambda self, slip, n: (self.share(slip, n) - 2.0) * slip}),
    "friction beyond the slip": ("friction has no upper limit", "impacts", {"share": unlimited}),
    "friction beyond the slip, by Coulomb's law": ("friction has no upper limit", "impacts", coulomb(limited=False)),
    "squares of both speeds": (SQUARE, "impacts", {"quotient": lambda self, approach, slip: approach**2 / slip**2}),
    "square of the slip": (SQUARE, "slippery floor", {"quotient": lambda self, approach, slip: approach / slip**2}),
    "slip not over its length": (SQUARE, "impacts", coulomb(1.0, lambda approach, slip: slip)),
    "square of the approach": (SQUARE, "bouncing box", {"wanted_normal": lambda self, u: -u + self.restitution * u * u}),
    "square of the angular speed": (SQUARE, "turning", {"rate": lambda self: np.linalg.norm(self.w) * Solver.rate(self)}),
    "restitution halved after each contact": (DECAYS, "later impacts", decaying(0.5)),
    "restitution halved before each contact": (DECAYS, "bouncing ball", decaying(0.5, before=True)),
    "restitution a tenth less": (DECAYS, "later impacts", decaying(0.9)),
    "restitution a thirtieth less": (DECAYS, "later impacts", decaying(0.97)),
    "quaternions swapped": (ORDER, "turning", SWAPPED),
    "quaternions swapped, with a gyroscopic term": (ORDER, "tumbling", gyroscopic(**SWAPPED)),
    "not normalised": ("not normalised after each step", "turning", {"normalised": lambda self, q: q}),
    "not normalised in an impact": ("not normalised after each step", "impacts", {"normalised": lambda self, q: q}),
    "position before velocity": ("the position is updated before the velocity", "velocity lag", {"advance": position_first}),
}


@pytest.mark.sample(1)
@pytest.mark.parametrize("title", MISTAKES)
def test_mistake_is_named(title):
    message, check, methods = MISTAKES[title]
    [text] = found(student(title, **methods), check).values()
    assert re.search(message, text), text


def test_wrong_inertia_is_not_taken_for_a_wrong_rebound():
    """Without friction each gives a normal impulse that is too large, by nearly as much in this scene."""
    engine_ = student(inverse_in_k=lambda self, R: R @ self.inertia @ R.T)
    type(engine_).shapes, type(engine_).declines = ("capsule",), lambda self, scene: None
    assert found(engine_, "striking capsule")["striking capsule"].startswith(NOT_INVERTED)


@pytest.mark.extended
def test_two_faults_of_which_one_does_not_act_are_not_named():
    """Half of the turn of an impact looks like twice the inertia on this floor, which boxes exclude, and pairs add a fault elsewhere."""
    engine_ = student(inverse_inertia=lambda self, R: 0.5 * turning(self, R), inverse_in_k=turning, **coulomb())
    type(engine_).declines = lambda self, scene: "damping" if scene.damping else Student.declines(self, scene)
    assert found(engine_, "slippery floor")["slippery floor"].startswith("attitude is off by")


def test_mistake_of_restitution_that_another_probe_excludes_is_not_named(monkeypatch):
    """Restitution by the square of the speed, in slow impacts alone and in all; without the searches for other faults."""
    monkeypatch.setattr(motions, "explain_motion", lambda *asked: None)
    monkeypatch.setattr(motions, "verify_no_decay", lambda engine_: None)
    monkeypatch.setattr(motions, "PROBES", [probe for probe in PROBES if probe.name in ("slow ball", "bouncing ball")])

    def squared(self, u):
        return -u + self.restitution * u * u

    def in_slow(self, u):
        return squared(self, u) if u > -0.2 else Solver.wanted_normal(self, u)

    assert IN_NORMAL not in found(student(wanted_normal=in_slow), "slow ball")["slow ball"]
    assert found(student(wanted_normal=squared), "slow ball") == {"slow ball": IN_NORMAL}


def test_inertia_of_the_start_is_named():
    """In a box that has turned by 1.16 rad when it strikes; bodies that do not spin before an impact hide the mistake."""

    def begin(self, scene, dt):
        Solver.__init__(self, scene, dt)
        self.first = rotation_matrix(self.q)

    engine_ = student(__init__=begin, inverse_inertia=lambda self, R: self.first @ inv(self.inertia) @ self.first.T)
    assert found(engine_, "corner", "spinning corner") == {"corner": OWN_LAW, "spinning corner": AT_START}


@pytest.mark.extended
def test_right_student_is_not_corrected():
    """What the method itself has wrong is noted: no gyroscopic term, and the laboratory's rule of friction."""
    checks = (
        "tumbling",
        "turning",
        "damped",
        "bouncing box",
        "slippery floor",
        "corner",
        "gripping corner",
        "spinning corner",
        "impacts",
        "later impacts",
        "velocity lag",
    )
    assert found(student(), *checks) == {
        "tumbling": "angular velocity stays constant, as without the gyroscopic term or with the inertia of a ball",
        "slippery floor": BY_SLIP,
        "corner": OWN_LAW,
        "spinning corner": OWN_LAW,
    }


def test_normal_impulses_are_right_without_a_gyroscopic_term():
    """The angular velocity after the impact is then constant, 0.104 rad/s off at the end."""
    engine_ = student(impulse=lambda self, K, u, u_normal: self.wanted_normal(u_normal) / K[1, 1] * UP)
    type(engine_).discretisation = lambda self, scene: None
    assert found(engine_, "corner") == {}


def test_law_of_the_note_is_recognised_where_it_is_not_stated():
    engine_ = student()
    type(engine_).discretisation = lambda self, scene: None
    assert found(engine_, "corner") == {"corner": OF_NOTE}


def test_friction_on_a_floor_without_any_is_not_the_law_of_the_note():
    """The floor grips a box that strikes it on a corner without a spin, and the velocities are those of the note's law."""

    def gripping(self, K, u, u_normal):
        impulse = np.linalg.solve(K, -self.restitution * u_normal * UP - u)
        along = impulse - (impulse @ UP) * UP
        most = 0.2 * (impulse @ UP) if self.w.any() else np.inf  # it slips with a spin
        return impulse - along * (1.0 - min(1.0, most / (np.linalg.norm(along) or 1.0)))

    engine_ = student(impulse=gripping)
    type(engine_).discretisation = lambda self, scene: None
    messages = found(engine_, "corner", "spinning corner")
    assert OF_NOTE not in messages.values()
    assert "friction" in messages["corner"]
    assert "friction" in messages["spinning corner"]


def test_fault_that_a_box_excludes_does_not_return_beside_one_that_changes_nothing():
    """Balls do not rebound, boxes do: restitution is not 0 for every scene, neither alone nor with a damping that no scene has."""
    of_balls = {"wanted_normal": lambda self, u: -(1.0 + (self.restitution if self.radius == 0.0 else 0.0)) * u}
    messages = found(student(**of_balls), "bouncing ball", "dull ball", "bouncing box")
    assert set(messages) == {"bouncing ball", "dull ball"}
    assert messages["bouncing ball"].startswith("restitution is 0")
    assert not [text for text in messages.values() if "every scene" in text or "damping" in text]


@pytest.mark.sample(4)
@pytest.mark.parametrize("name", ["wang", "mujoco", "mujoco[kappa=0.5]", "pybullet", "pybullet[coordinates=multibody]", "rapier", "dart"])
def test_no_mistake_is_named_in_a_right_engine(name):
    """Nor in one whose restitution depends on the phase of the step, as with a penetration that is only partly resolved in each step."""
    messages = found(engine(name), "impacts", "later impacts").values()
    assert not [text for text in messages if not text.startswith("restitution depends on the speed")]


@pytest.mark.extended
def test_restitution_that_depends_on_the_speed_does_not_decay():
    slower = {"wanted_normal": lambda self, u: -(1.0 + self.restitution / (1.0 - 0.5 * u)) * u}
    [message] = found(student(**slower), "later impacts").values()
    assert message.startswith("restitution depends on the speed: 0.296 at 2.05 m/s, 0.46")


def test_explicit_euler_that_states_its_lag_is_noted():
    engine_ = student(advance=position_first)
    solver = type(engine_).simulation

    def prepare(scene, dt):
        simulation = solver(scene, dt)
        simulation.velocity_lag = -0.5 * dt
        return simulation

    type(engine_).simulation = staticmethod(prepare)
    assert found(engine_, "velocity lag")["velocity lag"].startswith("the position is updated before the velocity, as in explicit Euler")

"""Mistakes in an impact: the velocities after it, predicted from those before it with each mistake, compared with the engine's.

With u = v + ω × r at the contact point, u_n and u_t its parts along the normal N and along the floor, and K = 1/M - r* I⁻¹ r* (eq 15):

    v + j/M,  ω + I⁻¹ (r × j),  K j = -(1 + e) u_n N - s u_t,   s = min(µ (1 + e) |u_n|/|u_t|, 1)

or, as Coulomb's law has it, j = j_n N - min(µ j_n, |u_t|/(t·K t)) t. The inertia may be wrong in K, in the second equation or in both.
A mistake is stated if it explains the velocities after one step of contact and no law of impact does without a mistake.

Source: H. Wang, Rigid Body Dynamics (lecture note), eq 7, 12 and 15 to 17.
"""

from collections.abc import Callable, Iterator
from itertools import pairwise, product, takewhile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.conformance.outcomes import CheckFailed, Declined, Noted
from dropspin.comparisons.conformance.probes import DT, accepted_scene, recorded
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.faults.mistakes import NOT_INVERTED, NOT_ROTATED, ROTATED_BACK, SQUARE
from dropspin.comparisons.faults.parameters import FAULT_MODELS
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.running.driving import Breakdown, record, try_record
from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.loading import from_mapping, read_toml
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import ORIENTATION, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.text import counted, rounded
from dropspin.scenarios.truths.impact_laws import LAWS, response_of, velocities_after
from dropspin.scenarios.variations import with_height

CLOSE = 5e-3
"""The largest difference of an explained change of the velocities, relative to that change; gravity acts before or after an impact."""
ALIKE = 5e-4
"""Such differences that tell two mistakes apart."""
APART = 4.0
"""Multiple of it by which a stated mistake differs from an impact without rebound."""
AGAINST = "friction has the wrong sign: it acts along the slip of the contact point, and has to act against it"
IN_FRICTION = f"{SQUARE}: in friction, whose impulse is at most µ times that of the normal force, along the slip over its length"
IN_NORMAL = f"{SQUARE}: the separation speed is e times the approach speed"
REVERSED = "friction has the wrong sign: it reverses the slip of the contact point, and has to reduce it"
BEYOND = (
    "friction has no upper limit: it reverses the slip of the contact point, which it may at most stop; with the factor "
    "1 - µ (1 + e) |u_n|/|u_t| of the slip, this factor must not be negative"
)
INTO_FLOOR = "restitution has the wrong sign: the contact point goes on into the floor"
OF_REBOUND = (IN_NORMAL, INTO_FLOOR)
OF_CENTRE = "restitution acts on the velocity of the centre of mass: the contact point has to separate at e times its own approach speed"
AT_START = "the inertia is rotated by the orientation at the start: in the world frame it is R I Rᵀ with the R of the impact"
NO_TURN = "the impulse does not turn the body: I⁻¹ (r × j) is not added to the angular velocity, or friction against rolling undoes it"
POINT_MASS = "the impulse is that of a point mass: K = 1/M - r* I⁻¹ r* lacks its second term"
BY_SLIP = "friction reduces the slip by at most µ (1 + e) times the approach speed, which follows from Coulomb's law for a point mass only"
OF_NOTE = (
    "impacts follow eq 11 and 15 of Wang's lecture note, whose impulse is not normal to the floor; if this is intended, name 'law note' "
    "in discretisation"
)
PECULIARITIES = (BY_SLIP, OF_NOTE)
LATER = "restitution decays from one contact to the next"
FILE, NEAR = Path(__file__).with_name("impacts.toml"), 0.02  # m, above the floor
FALL, SAME = 0.02, 0.25  # the least fall of a restitution, relative to it, and a difference that is none, relative to the fall
BESIDE = 1e-3
"""Distance of an impulse from the centre of a ball, over its radius, from which it is stated."""
CHANGED, SLOWEST, FEWEST, LASTING = 0.05, 0.1, 2, 1.0  # of a restitution; m/s; impacts; s

Inverse = Callable[[Array, Array], NDArray[Any]]
INVERSES: dict[str, Inverse] = {
    "": lambda R, inertia: R @ np.linalg.inv(inertia) @ R.T,
    NOT_ROTATED: lambda R, inertia: np.linalg.inv(inertia),
    ROTATED_BACK: lambda R, inertia: R.T @ np.linalg.inv(inertia) @ R,
    NOT_INVERTED: lambda R, inertia: R @ inertia @ R.T,
    f"{NOT_INVERTED}; and {NOT_ROTATED}": lambda R, inertia: inertia,
}
"""By the mistake, the inverse inertia in the world frame that an impact uses; R is from body to world."""


class Contact(NamedTuple):
    """A contact point before an impact.

    Attributes:
        velocities: Of the body, v and ω, shape (6,).
        point: r, from the centre of mass [m].
        mass: [kg].
        inertia: In the body frame [kg m²].
        axes: R, from body to world.
        axes_at_start: R at the start of the motion.
        floor: The floor.
    """

    velocities: Array
    point: Array
    mass: float
    inertia: Array
    axes: Array
    axes_at_start: Array
    floor: Floor

    @property
    def approach(self) -> Array:
        """u, the velocity of the contact point [m/s]."""
        return self.velocities[:3] + np.cross(self.velocities[3:], self.point)

    def after(self, impulse: Array, inverse: Array) -> Array:
        """The velocities after an impulse, shape (6,)."""
        return self.velocities + np.concatenate([impulse / self.mass, inverse @ np.cross(self.point, impulse)])


def check_impacts(engine: Engine) -> str:
    """No mistake explains the first impact of bodies that are thrown at a floor; the probes test whether the impact is right."""
    tables = read_toml(FILE, FILE.name).items()
    scenes = {name: with_height(from_mapping({"name": name.replace(" ", "-"), **content}), NEAR) for name, content in tables}
    refusals = {name: engine.refusal(scene) for name, scene in scenes.items()}
    accepted = [name for name, refusal in refusals.items() if refusal is None]
    for name in accepted:
        mistake = explain_impact(scenes[name], record(engine, scenes[name], DT, verify=False).motion)
        if mistake is not None and mistake not in PECULIARITIES:
            raise CheckFailed(f"{mistake} ({name})")
    if not accepted:
        raise Declined(f"the engine declines all scenes: {list(refusals.values())[-1]}")
    return f"impacts show no known mistake, in {counted(len(accepted), 'scene')}"


def explain_impact(scene: Scenario, motion: Trajectory) -> str | None:
    """The known mistake or rule that gives the velocities after the first step of contact; None if no known one does."""
    case = Comparison(scene, motion)
    if scene.floor is None or not case.states.touching.any():
        return None
    row = int(np.argmax(case.states.touching))
    before = motion.states[row].copy()
    before[VELOCITY] += case.dt * scene.acceleration
    velocities, after = (np.concatenate([state[VELOCITY], state[SPIN]]) for state in (before, motion.states[row + 1]))
    axes, at_start = (rotate(state[ORIENTATION], np.eye(3)).T for state in (before, motion.states[0]))
    contact = Contact(velocities, case.contact_point(row), scene.body.mass, scene.body.inertia_tensor, axes, at_start, scene.floor)
    weights = np.array([1.0] * 3 + [scene.body.size] * 3)

    def off(predicted: Array | None) -> float:
        scale = np.linalg.norm(weights * (after - velocities))
        return np.inf if predicted is None else float(np.linalg.norm(weights * (after - predicted)) / scale)

    if contact.approach[1] >= 0.0:
        return None
    frictionless = scene.floor.model_copy(update={"friction": "none"})
    # Smaller coefficients are faults of parameters, which the probes name; with larger ones a body may stick, as with a mistake.
    faulty = [fault.simulated(scene).floor for fault in FAULT_MODELS if fault.about == "friction"]
    others = [floor for floor in faulty if floor and 0.0 < floor.coefficient < scene.floor.coefficient < np.inf]
    floors, of_body = (scene.floor, frictionless, *others), (before, contact.point, contact.mass, contact.inertia)
    laws = [law for law in LAWS if any(off(velocities_after(*of_body, floor, law)) <= CLOSE for floor in floors)]
    if laws:
        return OF_NOTE if laws == ["note"] and scene.floor == frictionless else None
    # As when the floor supports a body from the first step on.
    dead = [floor.model_copy(update={"restitution": 0.0}) for floor in (scene.floor, frictionless)]
    if any(off(velocities_after(*of_body, floor, law)) <= APART * CLOSE for floor, law in product(dead, LAWS)):
        return None
    found = [(off(predicted), message) for message, predicted in _predictions(contact)]
    least = min(found)[0]  # without friction a wrong rebound may come near that of a wrong inertia
    return next((message for size, message in found if size <= least + ALIKE), None) if least <= CLOSE else None


def _predictions(contact: Contact) -> Iterator[tuple[str, Array]]:
    """Mistakes, and the velocities after an impact with each, shape (6,); the rule of the lecture note's laboratory is the first."""
    right, *wrong = ((mistake, inverse(contact.axes, contact.inertia)) for mistake, inverse in INVERSES.items())
    wrong.append((AT_START, INVERSES[""](contact.axes_at_start, contact.inertia)))
    for message, impulse in _impulses(contact, response_of(contact.point, contact.mass, right[1])):
        yield message, contact.after(impulse, right[1])
    # Nothing comes before an inertia that is not inverted: that of a small body is nearly nothing beside its inverse.
    responses, turns = ([right, (absent, np.zeros((3, 3))), *wrong] for absent in (POINT_MASS, NO_TURN))
    for (in_response, of_response), (in_turn, of_turn) in product(responses, turns):
        if in_response or in_turn:
            for message, impulse in _impulses(contact, response_of(contact.point, contact.mass, of_response)):
                if message == BY_SLIP:
                    yield "; and ".join(dict.fromkeys(filter(None, (in_response, in_turn)))), contact.after(impulse, of_turn)


def _impulses(contact: Contact, response: Array) -> Iterator[tuple[str, Array]]:
    """Impulses by the two rules without a mistake, called `BY_SLIP`, and then with one in the friction or the normal velocity."""
    u_n = float(contact.approach[1])
    u_t = contact.approach - u_n * UP
    e, friction, slip = contact.floor.restitution, contact.floor.coefficient, float(np.linalg.norm(u_t))
    along = u_t / slip if slip > 0.0 else u_t
    grip = slip / float(along @ response @ along) if slip > 0.0 else 0.0

    def by_slip(rebound: float, share: float) -> Array:
        return np.asarray(np.linalg.solve(response, (rebound - u_n) * UP - share * u_t))

    def by_force(rebound: float, factor: float, most: float = grip) -> Array:
        normal = (rebound - u_n) / float(response[1, 1])
        return normal * UP - np.sign(factor) * min(abs(factor) * friction * normal, most) * along

    rebound, speed = -e * u_n, -u_n
    limit = friction * (1.0 + e) * speed / slip if slip > 0.0 and friction > 0.0 else 0.0
    share = min(limit, 1.0)
    squared = ((IN_NORMAL, e * speed**2), (IN_NORMAL, (1.0 + e) * speed**2 - speed))
    upward = ((BY_SLIP, rebound), *squared, (INTO_FLOOR, -rebound), (OF_CENTRE, -e * float(contact.velocities[1])))
    for message, velocity in upward:
        yield message, by_slip(velocity, share)
        if np.isfinite(friction):
            yield message, by_force(velocity, 1.0)
    if limit == 0.0:
        return
    yield REVERSED, by_slip(rebound, 2.0 - share)
    for against in {share, limit} - {np.inf}:
        yield AGAINST, by_slip(rebound, -against)
    if np.isfinite(friction):
        yield BEYOND, by_slip(rebound, limit)
        yield BEYOND, by_force(rebound, 1.0, np.inf)
        yield AGAINST, by_force(rebound, -1.0)
        for factor in (speed, 1.0 / slip, speed / slip, slip):
            yield IN_FRICTION, by_slip(rebound, min(factor * limit, 1.0))
            yield IN_FRICTION, by_force(rebound, factor)


def turning_impulse(scene: Scenario, states: Array) -> str:
    """A message if a floor without friction turns a ball; `states`, shape (2, 13), are those before and after; empty if it does not."""
    change = states[1] - states[0]  # of a ball that neither slides nor spins, so that only the normal impulse can turn it
    if scene.floor is None or scene.floor.friction != "none" or not scene.body.is_ball or change[VELOCITY][1] <= 0.0:
        return ""
    arm = float(np.linalg.norm(scene.body.inertia_tensor @ change[SPIN]) / (scene.body.mass * change[VELOCITY][1]))
    if arm <= BESIDE * scene.body.size:
        return ""
    return f"a floor without friction turns a ball: the impulse acts {arm:.2g} m beside the centre of mass, which is the centre of the ball"


def check_later_impacts(engine: Engine) -> str:
    """Restitution is the same at each contact of a body that bounces."""
    verify_no_decay(engine)
    pairs, scene = restitutions(engine), accepted_scene(engine, "bouncing ball", "bouncing box")
    if turning := turning_impulse(scene, recorded(engine, scene)[[0, -1]]):
        raise CheckFailed(turning)
    if len(pairs) >= FEWEST and abs(pairs[1][0] - pairs[0][0]) > CHANGED * pairs[0][0]:
        raise Noted(f"restitution depends on the speed: {', '.join(f'{e:.3g} at {speed:.3g} m/s' for e, speed in pairs)}")
    return f"restitution in successive impacts: {', '.join(f'{e:.3g}' for e, _ in pairs)}"


def verify_no_decay(engine: Engine) -> None:
    """Raise `CheckFailed` if restitution falls from impact to impact, whatever the speed of the fall."""
    pairs = restitutions(engine)
    if len(pairs) < FEWEST or any(later[0] > (1.0 - FALL) * earlier[0] for earlier, later in pairwise(pairs)):
        return
    close = SAME * (pairs[0][0] - pairs[1][0])
    for speed in (pairs[1][1], 1.2 * pairs[0][1]):
        others = restitutions(engine, speed)
        if not others or any(abs(first[0] - second[0]) > close for first, second in zip(pairs[:2], others, strict=False)):
            return
    successive = ", ".join(rounded(e, 2) for e, _ in pairs)
    raise CheckFailed(f"{LATER}: {successive} in successive impacts; a scene has one restitution for all of them")


def restitutions(engine: Engine, speed: float | None = None) -> list[tuple[float, float]]:
    """The restitution and the approach speed [m/s] of each impact of a bouncing body, up to the first one slower than `SLOWEST`.

    Args:
        engine: The engine.
        speed: The speed at the start, shortly before the first impact [m/s]; that of the probe by default.
    """
    scene = accepted_scene(engine, "bouncing ball", "bouncing box")
    state = scene.initial_state
    state[VELOCITY] *= 1.0 if speed is None else speed / np.linalg.norm(state[VELOCITY])
    recording = try_record(engine, scene.starting_at(state).model_copy(update={"duration": LASTING}), DT, verify=False)
    if isinstance(recording, Breakdown):
        return []
    vertical = recording.motion.velocity[:, 1]
    runs = np.split(vertical, np.flatnonzero(np.diff(vertical > 0.0)) + 1)  # falls and rises in turn
    pairs = [(float(rise.max()), -float(fall.min())) for fall, rise in zip(runs[::2], runs[1::2], strict=False)]
    return [(rebound / approach, approach) for rebound, approach in takewhile(lambda pair: pair[1] > SLOWEST, pairs)]

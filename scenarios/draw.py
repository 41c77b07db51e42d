"""Random scenes, each with an exact solution. An engine can be tuned to a fixed list of scenes, but not to random ones.

The scenes are taken from fifteen families in turn. U(a, b) is a uniform, LU(a, b) a log-uniform distribution; directions and orientations
are uniformly distributed (from normal variates: G. Marsaglia, Annals of Mathematical Statistics 43 (1972)). The spin of a body is its
initial angular velocity.

    all           mass LU(0.01, 1000) kg; diameters and edge lengths LU(0.1, 1) m; points are normally distributed, with half of such a
                  length as standard deviation
    moments       of boxes, one third each: those of the solid body; those of eight corner masses; random moments, which are those
                  of a mass distribution whose mean square along each axis is U(0.1, 1) times the square of the half extent
    flights       velocity U(0, 3) m/s and spin LU(0.5, 12) rad/s in any direction; no gravity in three of ten flights, otherwise gravity
                  LU(0.5, 30) m/s² in any direction; duration U(0.5, 1) s
    floors        gravity LU(0.5, 30) m/s² downwards; restitution U(0.1, 0.95); infinite friction or none
    falls         time of the fall T = U(0.12, 0.3) s; initial upward velocity U(-0.5, 0.5) times g T/2; horizontal velocity U(0, 2) m/s;
                  the scene ends after U(0.5, 0.8) of the last flight, of which at most 0.3 s are used
    tilted        in three of ten falls of balls, corners, round bodies and meshes, gravity is inclined by U(0, 0.5) rad

    free-tensor   a flight of 4 to 8 points of unequal masses, whose axes are not principal axes
    free-axes     a flight of a ball or a box with random moments
    damped        a flight of any of these bodies, with decay rates U(0.1, 2) 1/s of velocity and of angular velocity
    ball          a ball on a frictionless floor, one to three impacts; spin LU(0.5, 12) rad/s; half of the balls have random moments
    rough-ball    a solid ball with spin, one impact; infinite friction, or a friction coefficient U(0.05, 0.6)
    flat-box      a box that lands on a face, one to three impacts; without friction it has spin U(-10, 10) rad/s about the vertical
    corner        a box, or in one of three cases a set of points, of any orientation; one impact; spin U(0, 3) rad/s
    edge          a box that lands on an edge, one impact; no spin
    on-floor      a box that slides, or turns about the vertical, with a friction coefficient U(0.1, 0.6); it stops after T = U(0.2, 0.6) s,
                  and the scene ends at 1.1 T
    standing      a box that falls over from an edge; the initial angle from balance is U(0.05, 0.3) rad, and the scene ends after
                  U(0.5, 0.8) of the time until the box lands; the edge sticks or slips; restitution 0
    strike        a capsule, a cylinder or an ellipsoid of any orientation, one impact; spin U(0, 3) rad/s
    lying         a capsule or a cylinder that lands on its side, or an ellipsoid that lands on its shortest axis, on a frictionless floor,
                  one to three impacts; spin U(-10, 10) rad/s about the vertical
    rolling       a ball, or a capsule or a cylinder on its side, thrown without spin, with a friction coefficient U(0.1, 0.6); it rolls
                  after T = U(0.2, 0.6) s, and the scene ends at 1.5 T
    mesh          a solid tetrahedron of any orientation, one impact; spin U(0, 3) rad/s
    wall          a ball that strikes a vertical wall after U(0.3, 0.7) of its fall, up to 0.5 rad from at right angles, and then the floor,
                  both without friction

A draw is repeated until its exact solution is known for the whole duration and the default time steps resolve the scene: each flight has
at least 16 steps of 4 ms; the body rotates by at most 0.1 rad in a step; and when one corner strikes the floor, every other corner is
higher above the floor than the distance that the body falls in a step.

Source of the exact solutions: `dropspin.scenarios.truths`.
"""

import numpy as np

from dropspin.scenarios.bodies.surface import depth_below_centre
from dropspin.scenarios.errors import DropspinError, SceneError
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.random_families import FAMILIES, OF_PLAIN_SHAPES
from dropspin.scenarios.random_variates import Draws
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY
from dropspin.scenarios.truths import Impact, truth_for

MOST_SCENES = 1000
"""Scenes of balls, boxes and points have the numbers up to this; those of the other families come after it."""
LARGEST_SEED = 2**64 - 1
COARSEST_STEP = 4e-3  # s, of a run by default
FLIGHT_STEPS, TURN = 16, 0.1  # fewest steps of a flight, and the largest turn in one [rad]
MOST_DRAWS = 1000  # of one scene; a dozen are usual


def draw(count: int, seed: int) -> list[Scenario]:
    """Generate random scenes; each has an exact solution for its whole duration.

    Scene k depends only on the seed and on k. `load` accepts its name, such as `draw-7-012` for scene 12 of seed 7.

    Args:
        count: Number of scenes, from 1 to 1000.
        seed: Seed, from 0 to 2⁶⁴ - 1. The same seed gives the same scenes with the same versions of dropspin and NumPy.

    Returns:
        The scenes. Of each fifteen scenes, ten are numbered from 1; the other five, with round bodies, meshes or walls, are numbered from
        1001.

    Raises:
        DropspinError: The count or the seed is out of range.
    """
    for name, number, least, most in (("count", count, 1, MOST_SCENES), ("seed", seed, 0, LARGEST_SEED)):
        if isinstance(number, bool) or not isinstance(number, int) or not least <= number <= most:
            raise DropspinError(f"{name}: got {number!r}; give a whole number from {least} to {most}.")
    return [drawn_scene(seed, _number(place)) for place in range(count)]


def _number(place: int) -> int:
    """The number of the scene at a place in the sequence, in which all families follow each other."""
    plain = len(OF_PLAIN_SHAPES)
    cycle, family = divmod(place, len(FAMILIES))
    if family < plain:
        return 1 + plain * cycle + family
    return 1 + MOST_SCENES + (len(FAMILIES) - plain) * cycle + family - plain


def drawn_scene(seed: int, number: int) -> Scenario:
    """One scene of a seed.

    Raises:
        SceneError: There is no such scene.
    """
    name = f"draw-{seed}-{number:03d}"
    if not (1 <= number <= 2 * MOST_SCENES and seed <= LARGEST_SEED):
        raise SceneError(f"scene {name!r}: scenes are drawn with seeds up to {LARGEST_SEED} and numbers from 1 to {2 * MOST_SCENES}.")
    families = OF_PLAIN_SHAPES if number <= MOST_SCENES else FAMILIES[len(OF_PLAIN_SHAPES) :]
    draw_content = families[(number - 1) % len(families)]
    family, summary = draw_content.__name__.replace("_", "-"), (draw_content.__doc__ or "").removesuffix(".")
    draws = Draws(np.random.default_rng([seed, number]))
    for _ in range(MOST_DRAWS):
        content, last_impact = draw_content(draws)
        scene = Scenario.model_validate({"name": name, "origin": name, "summary": summary, "tags": ["drawn", family], **content})
        drawn = scene if last_impact is None else _ended(scene, last_impact, draws.uniform(0.5, 0.8))
        if drawn is not None and _is_resolved(drawn):
            return drawn
    raise AssertionError(f"no scene of the family {family} was accepted in {MOST_DRAWS} draws")


def _ended(scene: Scenario, last_impact: int, share: float) -> Scenario | None:
    """The scene, which ends at a random time between one of its impacts and the next; None if it has too few impacts."""
    truth = truth_for(scene)
    if truth is None or len(truth.events) < last_impact:
        return None
    times = [0.0, *(event.time for event in truth.events), min(truth.horizon, scene.duration)]
    begins, ends = times[last_impact : last_impact + 2]
    return scene.model_copy(update={"duration": begins + share * (ends - begins)})


def _is_resolved(scene: Scenario) -> bool:
    """Whether the exact solution is known for the whole duration, and the default time steps resolve it."""
    truth = truth_for(scene)
    if truth is None or not truth.covers_all(scene.duration):
        return False
    times = np.array([0.0, *(event.time for event in truth.events), scene.duration])
    spins = [truth(np.linspace(0.0, scene.duration, 65)).angular_velocity, *(event.after[np.newaxis, SPIN] for event in truth.events)]
    return (
        bool(np.diff(times).min() >= FLIGHT_STEPS * COARSEST_STEP)
        and float(np.linalg.norm(np.concatenate(spins), axis=1).max()) * COARSEST_STEP <= TURN
        and all(_strikes_alone(scene, event) for event in truth.events)
    )


def _strikes_alone(scene: Scenario, impact: Impact) -> bool:
    """Whether, at every impact, all other corners are so far from the floor that no time step contains two contacts."""
    points = rotate(impact.before[ORIENTATION], scene.body.vertices)
    heights = impact.before[POSITION][1] + points[:, 1] - float(depth_below_centre(impact.before[ORIENTATION], scene.body.semi_axes))
    speeds = impact.before[VELOCITY][1] + np.cross(impact.before[SPIN], points)[:, 1]
    apart = heights > heights.min() + 1e-9 * scene.body.size
    return bool((heights - heights.min() > -COARSEST_STEP * np.minimum(speeds, 0.0))[apart].all())

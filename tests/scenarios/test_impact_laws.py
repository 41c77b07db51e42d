"""One impulse at one point by every law, compared with 40 digits: momentum balances and the conditions of the law as one linear system."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mpmath import mp, mpf
from support.taylor import free_rotor as taylor_rotor

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.state import ORIENTATION, POSITION, RATES
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths import LAWS
from dropspin.scenarios.truths.impact_laws import FRICTION_LAWS, law_of, velocities_after

vectors = arrays(float, 3, elements=st.floats(-3, 3, allow_subnormal=False))
INERTIA, MASS = np.diag([0.3, 0.5, 0.6]), 1.3


def solved(corner, v, w, conditions, inertia=INERTIA, mass=MASS):
    """v⁺, ω⁺ and j from M (v⁺ - v) = j, I (ω⁺ - ω) = r × j and three conditions, each a function that fills its row."""
    A, b = mpmath.zeros(9), mpmath.zeros(9, 1)
    rx = mpmath.matrix([[0, -corner[2], corner[1]], [corner[2], 0, -corner[0]], [-corner[1], corner[0], 0]])
    for i in range(3):
        A[i, i], A[i, 6 + i], b[i] = mass, -1, mass * mpf(v[i])
        for k in range(3):
            A[3 + i, 3 + k] = mpf(inertia[i][k])
            b[3 + i] += mpf(inertia[i][k]) * mpf(w[k])
            A[3 + i, 6 + k] = -rx[i, k]
    for row, (weights_of_velocity, weights_of_impulse, value) in enumerate(conditions):
        for i in range(3):
            A[6 + row, i] += weights_of_velocity[i]
            for k in range(3):
                A[6 + row, 3 + k] += -weights_of_velocity[i] * rx[i, k]  # v⁺ + ω⁺ × r
            A[6 + row, 6 + i] += weights_of_impulse[i]
        b[6 + row] = value
    return mpmath.lu_solve(A, b)


def velocity(i, value):
    return [int(i == k) for k in range(3)], [0, 0, 0], value


def impulse(i, value):
    return [0, 0, 0], [int(i == k) for k in range(3)], value


def by_mpmath(law, corner, v, w, e, friction, inertia=INERTIA, mass=MASS):
    """v⁺ and ω⁺ of one law."""
    arguments = {"inertia": inertia, "mass": mass}
    u = [mpf(v[i]) + mpf(w[(i + 1) % 3]) * mpf(corner[(i + 2) % 3]) - mpf(w[(i + 2) % 3]) * mpf(corner[(i + 1) % 3]) for i in range(3)]
    e = mpf(e)
    newton = solved(corner, v, w, [velocity(0, 0), velocity(1, -e * u[1]), velocity(2, 0)], **arguments)
    if friction == "none" and law == "note":
        found = solved(corner, v, w, [velocity(0, u[0]), velocity(1, -e * u[1]), velocity(2, u[2])], **arguments)
    elif friction == "none" or law == "normal":
        found = solved(corner, v, w, [impulse(0, 0), velocity(1, -e * u[1]), impulse(2, 0)], **arguments)
    elif law == "note":
        found = newton
    elif law == "poisson":  # (1 + e) times the normal impulse that stops the point, which ends without sliding
        stop = solved(corner, v, w, [velocity(0, 0), velocity(1, 0), velocity(2, 0)], **arguments)
        push = stop[7] + e * max(stop[7], 0)
        found = solved(corner, v, w, [velocity(0, 0), impulse(1, push), velocity(2, 0)], **arguments)
    elif law == "clamped":

        def energy(values):
            linear = mass * sum(mpf(c) ** 2 for c in values[POSITION])
            return linear + sum(mpf(inertia[i][k]) * mpf(values[3 + i]) * mpf(values[3 + k]) for i in range(3) for k in range(3))

        found, before = newton, energy([*v, *w])
        if energy(newton) > before:  # E after is a + b s², s the speed at which the point leaves
            stop = solved(corner, v, w, [velocity(0, 0), velocity(1, 0), velocity(2, 0)], **arguments)
            one = solved(corner, v, w, [velocity(0, 0), velocity(1, 1), velocity(2, 0)], **arguments)
            s = mpmath.sqrt((before - energy(stop)) / (energy(one) - energy(stop)))
            found = solved(corner, v, w, [velocity(0, 0), velocity(1, s), velocity(2, 0)], **arguments)
    else:
        found = newton
        f = mpf(friction)
        if mpmath.hypot(newton[6], newton[8]) > f * newton[7]:
            slide = mpmath.hypot(u[0], u[2])
            cone = [([0, 0, 0], [int(i == 0), f * u[i] / slide, int(i == 2)], 0) for i in (0, 2)]
            found = solved(corner, v, w, [cone[0], velocity(1, -e * u[1]), cone[1]], **arguments)
    return [float(value) for value in found[:6]]


@pytest.mark.sample(1)
@pytest.mark.parametrize("law", [law for law in LAWS if law not in FRICTION_LAWS])
@pytest.mark.parametrize("friction", ["none", "infinite", 0.3])
@given(vectors.filter(lambda r: r[1] < -0.1), vectors.filter(lambda v: v[1] < -0.1), vectors, st.floats(0, 1))
def test_each_law_matches_forty_digits(law, friction, corner, v, w, e):
    """To 1e-12 of the largest velocity (measured 2e-14)."""
    u = v + np.cross(w, corner)
    if (friction == 0.3) != (law == "coulomb") or u[1] > -0.1 or np.hypot(u[0], u[2]) < 0.1:
        return  # where the law is not defined, or cannot be distinguished from another
    state = np.concatenate([[0, 1, 0], [0, 0, 0, 1], v, w])
    with mp.workdps(40):
        exact = by_mpmath(law, corner, v, w, e, friction)
    found = velocities_after(state, corner, MASS, INERTIA, Floor(restitution=e, friction=friction), law)
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-12 * max(1.0, np.abs(exact).max()))


@pytest.mark.sample(6)
@pytest.mark.parametrize("name", ["drop-box-corner", "drop-box-sticking", "drop-box-tumble"])
@pytest.mark.parametrize("law", ["normal", "note", "poisson", "clamped"])
def test_flight_and_first_impact_match_forty_digits(name, law):
    """Flight by Taylor series, the time by bisection of the corner's height, the impulse by linear equations: all to 1e-12."""
    scene = load(name)
    friction = "none" if law == "normal" else "infinite"
    scene = scene.model_copy(update={"floor": Floor(restitution=scene.floor.restitution, friction=friction)})
    impact = truth_for(scene, law).events[0]
    moments = np.diag(scene.body.inertia_tensor).tolist()
    start = scene.start
    with mp.workdps(40):
        x, y, z, s = (mpf(c) for c in start.orientation)
        length = mpmath.sqrt(x * x + y * y + z * z + s * s)
        spin = to_body([c / length for c in (x, y, z, s)], [mpf(c) for c in start.angular_velocity])
        corner = scene.body.vertices[lowest_corner(scene, impact)]

        def state_at(t):
            [(q, w)] = taylor_rotor(moments, spin, start.orientation, [t])
            return q, w, to_world(q, [mpf(c) for c in corner])

        def height(t):
            return mpf(start.position[1]) + mpf(start.velocity[1]) * t - mpf("4.9") * t * t + state_at(t)[2][1]

        t, before = mpf(impact.time), mpf(impact.time) - mpf("1e-9")
        for _ in range(3):  # secants; the error starts at 1e-15 and is squared at least by every other one
            t, before = t - height(t) * (t - before) / (height(t) - height(before)), t
            if t == before:
                break
        q, w, r = state_at(t)
        axes = [to_world(q, [int(i == k) for k in range(3)]) for i in range(3)]
        tensor = [[sum(moments[n] * axes[n][i] * axes[n][k] for n in range(3)) for k in range(3)] for i in range(3)]
        v = [mpf(start.velocity[i]) - (mpf("9.8") * t if i == 1 else 0) for i in range(3)]
        exact = by_mpmath(law, r, v, to_world(q, w), scene.floor.restitution, friction, tensor, scene.body.mass)
    assert impact.time == pytest.approx(float(t), rel=1e-12)
    np.testing.assert_allclose(impact.after[RATES], exact, rtol=0, atol=1e-12 * np.abs(exact).max())


def lowest_corner(scene, impact):
    from dropspin.scenarios.rotations import rotate

    return int(np.argmin(rotate(impact.before[ORIENTATION], scene.body.vertices)[:, 1]))


def to_world(q, a):
    x, y, z, w = q
    twice = [2 * (y * a[2] - z * a[1]), 2 * (z * a[0] - x * a[2]), 2 * (x * a[1] - y * a[0])]
    return [
        a[0] + w * twice[0] + y * twice[2] - z * twice[1],
        a[1] + w * twice[1] + z * twice[0] - x * twice[2],
        a[2] + w * twice[2] + x * twice[1] - y * twice[0],
    ]


def to_body(q, a):
    return to_world([-q[0], -q[1], -q[2], q[3]], a)


@pytest.mark.parametrize("friction", [0.05, 0.2, 5.0])
def test_ball_slips_or_sticks_by_its_coulomb_coefficient(friction):
    """It slips if f (1 + e) |u_n| is less than |u_t| / (1 + 1/β), which stops it, with I = β M R². To 1e-14."""
    scene = load(
        {
            "name": "grazing",
            "duration": 0.3,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 1.5},
            "start": {"position": [0, 0.4, 0], "velocity": [2.0, -3.0, 0.5], "angular_velocity": [1.0, 7.0, 40.0]},
            "floor": {"restitution": 0.8, "friction": friction},
        }
    )
    truth = truth_for(scene)
    [impact] = truth.events
    assert truth.name == "ball-impact"
    sliding = np.array([2.0 + 0.1 * 40.0, 0.0, 0.5 - 0.1 * 1.0])
    speed = np.linalg.norm(sliding)
    lost = min(friction * 1.8 * 3.0, speed / (1 + 1 / 0.4))
    kick = -lost * sliding / speed
    spin = np.array([1.0, 7.0, 40.0]) + np.cross([0.0, -0.1, 0.0], kick) / (0.4 * 0.1**2)
    np.testing.assert_allclose(impact.after[RATES], [2.0 + kick[0], 2.4, 0.5 + kick[2], *spin], rtol=0, atol=2e-14 * 40)


def test_law_of_the_floor_follows_its_friction():
    """The normal impulse without friction, eq 17 with infinite friction, else the cone law, which is Coulomb's formula for a ball."""
    box, ball = load("drop-box-corner"), load("drop-ball")

    def law(scene, friction):
        return law_of(scene.model_copy(update={"floor": Floor(restitution=0.5, friction=friction)}))

    assert [law(box, f) for f in ("none", 0.0, "infinite", 0.3)] == ["normal", "normal", "note", "cone"]
    assert [law(ball, f) for f in ("none", 0.0, "infinite", 0.3)] == ["normal", "normal", "note", "coulomb"]
    assert truth_for(load("slide-box")).name == "coulomb-slide"

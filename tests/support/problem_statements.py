"""The statement of a numbered problem in words and numbers: what another program needs to reproduce it."""

import numpy as np

from dropspin.scenarios.bodies.inertia import is_diagonal

CONVENTIONS = """SI units. The world frame is right-handed with y up. x and v are the position and the velocity of the centre of
mass, and ω is the angular velocity, all in the world frame. q = [x, y, z, w] is a unit quaternion with the scalar last that turns
vectors of the body frame, whose origin is the centre of mass, into the world frame: r_world = q r_body q*, dq/dt = ½ [ω, 0] q. q
and −q are the same orientation; the one with w ≥ 0 is printed. M is the mass, I the inertia tensor turned into the world frame,
and L = I ω."""

FLIGHT = "In flight dv/dt = g and dL/dt = 0."
IMPACT = """The body is in flight until a point of it reaches the floor and descends. An impact takes no time and does not
change x and q. An impulse j acts at this point, which is at r from the centre of mass and has the velocity u = v + ω × r. It changes
v by j/M and ω by I⁻¹ (r × j)."""
SMOOTH = "j is vertical (no friction), and such that u_y becomes -e u_y (Newton's restitution); the horizontal parts of u may change too."
STICKING = """j is such that u becomes [0, -e u_y, 0]: Newton's restitution of the normal velocity, and infinite friction, which
ends the sliding of this point whatever the ratio of the tangential to the normal impulse."""
CONE = """u_y becomes -e u_y (Newton's restitution), and j is in the cone of Coulomb friction: its horizontal part is at most f times its
vertical part j_y. Either the horizontal part of u becomes 0, or it becomes s d with a unit vector d and s > 0, and then
j = j_y ([0, 1, 0] - f d): friction acts against the remaining slip, which need not have the direction of the slip before."""
EDGE = "The two ends of an edge strike at once, with equal velocities; r is the middle of the edge."
SEVERAL = """Where several points touch a plane at once, as when the body rests, these laws do not determine the impulses: each method
has its own rule."""
PENDULUM = """The body stands on one edge, that of its lowest corners, which stays at rest on the floor. The body turns about it
without friction or slip, as a rigid pendulum: (I_e + M R²) d²ψ/dt² = M |g| R sin ψ, with ψ the angle from the direction against
gravity to the line from the edge to the centre of mass, R the length of this line and I_e the moment of inertia about the direction
of the edge through the centre of mass."""
LANDING = """When the next edge reaches the floor, the body turns about that edge from then on, and the old edge leaves the
floor: the angular momentum about the new edge is the same before and after (Housner's landing: infinite friction, restitution 0; x
and q do not jump, v and ω do)."""
RESTS = """When the body rocks about the two edges of one face, the times between landings become ever shorter and the
landings accumulate; from then on the body lies still."""

LAWS = {
    "principal-spin": (FLIGHT,),
    "free-rotor": (FLIGHT,),
    "ball-impact": (IMPACT, FLIGHT, "The point of a ball that strikes is the lowest, r = [0, -radius, 0]."),
    "corner-impact": (IMPACT, FLIGHT),
    "edge-impact": (IMPACT, FLIGHT, EDGE),
    "tipping": (PENDULUM,),
    "rocking": (PENDULUM, LANDING, RESTS),
    "rimless-wheel": (PENDULUM, LANDING, RESTS),
    "slipping": (
        """The body stands on one edge, that of its lowest corners. The floor exerts only vertical forces, at this edge,
which stays on the floor and slides: the horizontal velocity of the centre of mass is constant. The energy M v²/2 + ω·L/2 - M g·x is
constant.""",
    ),
    "coulomb-slide": (
        """The box lies flat and stays so: the normal force acts where it balances the moment of friction. While it slides,
friction has the size f M |g_y| and acts against v: dv/dt = g_t - f |g_y| v/|v|, with g_t the horizontal part of g. It stops where v
is 0 and stays there if |g_t| ≤ f |g_y|; it does not start if it is at rest and this holds.""",
    ),
    "coulomb-turn": (
        """The box lies flat and stays so, and its centre of mass does not move. Its four lower corners, not the face between
them, touch the floor, each with a quarter of the weight; friction at each has the size f times this and acts against the corner's
velocity, until the box stops.""",
    ),
    "rolling": (
        """The ball stays on the floor; its contact point, at r = [0, -radius, 0], has the velocity s = v + ω × r. Friction F
acts there: M dv/dt = M g_t + F, dL/dt = r × F, with g_t the horizontal part of g. While s is not 0, F = -f M |g_y| s/|s|. From the
time at which s is 0, the ball rolls without slip: F is what keeps s at 0. Nothing resists rolling or turning about the vertical.""",
    ),
    "rough-contact": (
        """One point of the body, at r from its centre of mass, touches the floor and does not slip: v = -ω × r. The floor
exerts a force F on it, and no moment: M dv/dt = M g + F, dL/dt = r × F. A corner that touches the floor stays where it is. No other point
touches the floor.""",
    ),
    "smooth-contact": (
        """One point of the body, at r from its centre of mass, touches the floor and has no velocity along y: v_y = -(ω × r)_y.
The floor exerts a vertical force F on it, and no moment: M dv/dt = M g + F, dL/dt = r × F. No other point touches the floor.""",
    ),
}
"""For the name of each exact solution, the laws of the motion; those that depend on the scene are added by `laws`."""

KINDS = {
    "measured": "a recording, no exact solution",
    "ball-impact": "closed form",
    "bounce-ladder": "closed form",
    "corner-impact": "elliptic functions; impact times by root finding",
    "coulomb-slide": "closed form",
    "coulomb-turn": "closed form",
    "damped-free-rotor": "elliptic functions",
    "damped-parabola": "closed form",
    "edge-impact": "closed form; impact time by root finding",
    "free-rotor": "elliptic functions",
    "principal-spin": "closed form",
    "rimless-wheel": "elliptic functions",
    "rocking": "elliptic functions",
    "rough-contact": "numerical integration",
    "rolling": "closed form; numerical integration where the axis of rotation turns",
    "slipping": "quadrature",
    "smooth-contact": "numerical integration",
    "tipping": "elliptic functions",
}
"""The kind of each exact solution, by its name."""


MOST_POINTS = 100
"""Points that are printed."""
WALLS = """An impact with a wall is one with the floor in axes whose y axis is the wall's normal n: the point that strikes is the one
behind the wall, and e and the friction are the wall's."""


def laws(scene, truth):
    """The laws of the motion of a scene, sentences; `truth` is None if no exact solution is known."""
    name = "" if truth is None else truth.name
    found = list(LAWS.get(name, ()) if truth else (IMPACT, SEVERAL))
    if scene.damping is not None:
        linear, angular = number(scene.damping.linear), number(scene.damping.angular)
        found.append(f"A medium resists in proportion to the velocities: dv/dt = g - {linear} v, dL/dt = -{angular} L.")
    if truth is None or name.endswith("-impact"):
        found.append({"none": SMOOTH, "infinite": STICKING}.get(scene.floor.friction, CONE))
    if name == "bounce-ladder":
        found.append(_bounces(scene, truth))
    if scene.wall is not None:
        found.append(WALLS)
    return [" ".join(one.split()) for one in found]


def _bounces(scene, truth):
    """The law of a body whose impacts do not change its rotation."""
    if truth.events[0].time == 0.0:
        return "The floor carries the body and exerts no friction: x is constant, and the body turns about the vertical as a free body."
    face = "" if scene.body.is_ball else "The four lower corners strike at once, so that the box stays flat. "
    law = f"{face}Between impacts dv/dt = g. When the lowest point reaches the floor, v_y becomes -e v_y (Newton's restitution)."
    if scene.floor.rest_speed:
        return f"{law} An impact slower than {number(scene.floor.rest_speed)} m/s has e = 0; after it the body lies still."
    if scene.floor.restitution == 1.0:
        return law
    return f"""{law} The impacts accumulate at t = t₁ + (2 |v₁|/|g_y|) e/(1 - e), with t₁ the time of the first and v₁ the velocity before
        it; from then on the body lies still."""


def statement(scene):
    """The rows of the statement: what, and its value."""
    start = scene.start
    rows = {"body": _shape(scene.body), "mass": f"{number(scene.body.mass)} kg", "inertia": _inertia(scene.body)}
    for name, value, unit in (
        ("x", start.position, "m"),
        ("q", start.orientation, ""),
        ("v", start.velocity, "m/s"),
        ("ω", start.angular_velocity, "rad/s"),
    ):
        rows[f"{name} at t = 0"] = f"{vector(value)} {unit}".strip()
    rows["gravity"] = "none" if scene.gravity is None else f"g = {vector(scene.gravity.acceleration)} m/s²"
    rows["floor"] = "none" if scene.floor is None else _floor(scene.floor)
    for number_of_wall, wall in enumerate(scene.wall or ()):
        surface = _floor(wall).partition(", fixed")[2]
        rows[f"wall {number_of_wall}"] = (
            f"the plane through {vector(wall.point)} m with the normal n = {vector(wall.normal)}, fixed{surface}"
        )
    rows["duration"] = f"{number(scene.duration)} s"
    if scene.ensemble is not None:
        rows["ensemble"] = _ensemble(scene)
    return rows


def _shape(body):
    if body.shape == "sphere":
        return f"ball of radius {number(body.radius)} m, centre of mass at its centre"
    if body.shape == "box":
        at = f"{vector(body.centre)} m from its centre" if body.centre.any() else "at its centre"
        return f"box with the half extents {vector(body.half_extents)} m along its axes, centre of mass {at}"
    count = f"{len(body.vertices)} points"
    if len(body.vertices) > MOST_POINTS:
        return f"a mesh; planes touch its {count}, those of the file beside the scene's, taken from the centre of mass"
    points = ", ".join(vector(point, computed) for point in body.vertices)
    return f"the convex hull of {count}, given from the centre of mass [m]: {points}"


def _inertia(body):
    tensor = body.inertia_tensor
    rows = vector(np.diag(tensor), computed) if is_diagonal(tensor) else ", ".join(vector(row, computed) for row in tensor)
    about = "principal moments along the body's axes" if is_diagonal(tensor) else "tensor, by rows"
    why = {"solid": "; homogeneous", "vertices": "; all mass in equal parts at the corners"}.get(
        str(body.inertia), "; given, whatever the shape"
    )
    return f"{about}: {rows} kg m²{why}"


def _floor(floor):
    named = {"none": "no friction", "infinite": "infinite friction"}
    friction = named.get(str(floor.friction)) or f"Coulomb friction f = {number(floor.friction)}"
    return f"the plane y = 0, fixed; restitution e = {number(floor.restitution)}, {friction}"


def _ensemble(scene):
    one = scene.ensemble
    return (
        f"the scene also has {one.size} starts drawn with seed {one.seed}, with orientations uniform over all rotations, angular "
        f"velocities uniform within ± {vector(one.angular_velocity)} rad/s of the start above, and the lowest point as high as in it; "
        "this sheet is about the start above"
    )


def number(value):
    """A number with as many digits as identify it."""
    return repr(float(value)).removesuffix(".0")


def computed(value):
    """A number that was computed, without the rounding of its last digit."""
    return f"{value:.15g}" if abs(value) > 1e-17 else "0"


def vector(values, written=number):
    """Numbers in brackets."""
    return f"[{', '.join(written(value) for value in values)}]"

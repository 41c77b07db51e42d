"""The statement of a numbered problem in words and numbers: what another program needs to reproduce it."""

import numpy as np

from dropspin.scenarios.bodies.inertia import is_diagonal

CONVENTIONS = """All quantities are in SI units. The world frame is right-handed, and y is up. x and v are the position and the velocity of
the centre of mass, and ω is the angular velocity; all are in the world frame. The origin of the body frame is the centre of mass. The unit
quaternion q = [q_x, q_y, q_z, q_w] rotates vectors from the body frame to the world frame: r_world = q r_body q*, and
dq/dt = ½ [ω, 0] q. q and −q are the same orientation; the tables give the one with q_w ≥ 0. M is the mass, I is the inertia tensor in the
world frame, and L = I ω is the angular momentum about the centre of mass."""

FLIGHT = "In flight, dv/dt = g and dL/dt = 0."
IMPACT = """The body is in flight until one of its points reaches the floor while moving down. An impact takes no time and changes
neither x nor q. An impulse j acts at this point; it changes v by j/M and ω by I⁻¹ (r × j), where r is the position of the point relative to
the centre of mass. u = v + ω × r is the velocity of the point."""
SMOOTH = """The floor has no friction, so j is vertical. Its size is such that u_y becomes -e u_y (Newton's restitution). The horizontal
components of u may change too."""
STICKING = """j is such that u becomes [0, -e u_y, 0]: the normal velocity changes by Newton's restitution, and infinite friction ends the
sliding of this point, however large the tangential impulse must be."""
CONE = """j is such that u_y becomes -e u_y (Newton's restitution), and it is in the cone of Coulomb friction: its horizontal part is at
most f times its vertical part j_y. After the impact, the point either sticks or slips. If it sticks, the horizontal part of u is 0. If it
slips, the horizontal part of u is s d with a unit vector d and s > 0, and j = j_y ([0, 1, 0] - f d): friction opposes the slip after the
impact, which may have another direction than the slip before the impact."""
EDGE = "The two ends of the edge strike at the same time, with equal velocities; r is the position of the middle of the edge."
SEVERAL = """If several points touch a plane at the same time, for example when the body rests, these laws do not determine the impulses.
Each numerical method has its own rule for this case."""
PENDULUM = """The body stands on the edge between its lowest corners, which stays at rest on the floor. The body turns about this edge as a
rigid pendulum, without slip and without a frictional moment: (I_e + M R²) d²ψ/dt² = M |g| R sin ψ. R is the length of the line from the
edge to the centre of mass, and ψ is the angle of this line from the direction against gravity. I_e is the moment of inertia about the axis
through the centre of mass parallel to the edge."""
LANDING = """When the next edge reaches the floor, the body turns about that edge from then on, and the old edge leaves the floor. The
angular momentum about the new edge is the same before and after this landing (Housner's model, with infinite friction and restitution 0). x
and q do not jump; v and ω do."""
RESTS = """When the body rocks between the two edges of one face, the times between landings become ever shorter, and infinitely many
landings occur within a finite time. From then on, the body lies still."""

LAWS = {
    "principal-spin": (FLIGHT,),
    "free-rotor": (FLIGHT,),
    "ball-impact": (IMPACT, FLIGHT, "A ball strikes the floor with its lowest point, r = [0, -radius, 0]."),
    "corner-impact": (IMPACT, FLIGHT),
    "edge-impact": (IMPACT, FLIGHT, EDGE),
    "tipping": (PENDULUM,),
    "rocking": (PENDULUM, LANDING, RESTS),
    "rimless-wheel": (PENDULUM, LANDING, RESTS),
    "slipping": (
        """The body stands on the edge between its lowest corners, which stays on the floor and slides. The floor exerts only vertical
forces, at this edge, so that the horizontal velocity of the centre of mass is constant. The energy M v²/2 + ω·L/2 - M g·x is constant.""",
    ),
    "coulomb-slide": (
        """The box lies flat and stays flat, because the normal force acts where it balances the moment of friction. While the box slides,
friction has the size f M |g_y| and opposes v: dv/dt = g_t - f |g_y| v/|v|, where g_t is the horizontal part of g. When v becomes 0, the box
stops, and it stays at rest if |g_t| ≤ f |g_y|. Under the same condition, a box that starts at rest stays at rest.""",
    ),
    "coulomb-turn": (
        """The box lies flat and stays flat, and its centre of mass does not move. Only its four lower corners touch the floor, not the
face between them, and each corner carries a quarter of the weight. The friction at each corner is f times this load and opposes the
velocity of the corner, until the box stops.""",
    ),
    "rolling": (
        """The ball stays on the floor. Its contact point, at r = [0, -radius, 0], has the velocity s = v + ω × r, and a friction force F
acts there: M dv/dt = M g_t + F, dL/dt = r × F, where g_t is the horizontal part of g. While s is not 0, F = -f M |g_y| s/|s|. When s
becomes 0, the ball rolls without slip from then on; F is then the force that keeps s at 0. Nothing resists rolling or a rotation about the
vertical.""",
    ),
    "rough-contact": (
        """One point of the body, at r from its centre of mass, touches the floor and does not slip: v = -ω × r. The floor exerts a force F
and no moment at this point: M dv/dt = M g + F, dL/dt = r × F. If the point is a corner, it stays where it is. No other point touches the
floor.""",
    ),
    "smooth-contact": (
        """One point of the body, at r from its centre of mass, touches the floor and has no velocity along y: v_y = -(ω × r)_y. The floor
exerts a vertical force F and no moment at this point: M dv/dt = M g + F, dL/dt = r × F. No other point touches the floor.""",
    ),
}
"""For the name of each exact solution, the laws of the motion; those that depend on the scene are added by `laws`."""

KINDS = {
    "measured": "a recording, no exact solution",
    "ball-impact": "in closed form",
    "bounce-ladder": "in closed form",
    "corner-impact": "with elliptic functions, and the impact times by root finding",
    "coulomb-slide": "in closed form",
    "coulomb-turn": "in closed form",
    "damped-free-rotor": "with elliptic functions",
    "damped-parabola": "in closed form",
    "edge-impact": "in closed form, and the impact time by root finding",
    "free-rotor": "with elliptic functions",
    "principal-spin": "in closed form",
    "rimless-wheel": "with elliptic functions",
    "rocking": "with elliptic functions",
    "rough-contact": "by numerical integration",
    "rolling": "in closed form, and the orientation by numerical integration if the axis of rotation turns",
    "slipping": "by quadrature",
    "smooth-contact": "by numerical integration",
    "tipping": "with elliptic functions",
}
"""The kind of each exact solution, by its name."""


MOST_POINTS = 100
"""Points that are printed."""
WALLS = """The laws of an impact with the floor also hold for a wall, in axes whose y axis is the normal n of the wall. The point that
strikes is the one that reaches the plane of the wall, and e and the friction are those of the wall."""


def laws(scene, truth):
    """The laws of the motion of a scene, sentences; `truth` is None if no exact solution is known."""
    name = "" if truth is None else truth.name
    found = list(LAWS.get(name, ()) if truth else (IMPACT, SEVERAL))
    if scene.damping is not None:
        found.append(_damped(scene))
    if truth is None or name.endswith("-impact"):
        found.append({"none": SMOOTH, "infinite": STICKING}.get(scene.floor.friction, CONE))
    if name == "bounce-ladder":
        found.append(_bounces(scene, truth))
    if scene.wall is not None:
        found.append(WALLS)
    return [" ".join(one.split()) for one in found]


def _damped(scene):
    """The law of flight in a viscous medium."""
    linear, angular = (f"({number(rate)} s⁻¹)" if rate else "" for rate in (scene.damping.linear, scene.damping.angular))
    velocity = f"g - {linear} v" if linear else "g"
    return f"In flight, a viscous medium damps the motion: dv/dt = {velocity}, dL/dt = {f'-{angular} L' if angular else 0}."


def _bounces(scene, truth):
    """The law of a body whose impacts do not change its rotation."""
    if truth.events[0].time == 0.0:
        return "The floor carries the body without friction: x is constant, and the body turns about the vertical at constant speed."
    face = "" if scene.body.is_ball else "The four lower corners strike at the same time, so the box stays flat. "
    law = f"{face}Between impacts, dv/dt = g. When the lowest point reaches the floor, v_y becomes -e v_y (Newton's restitution)."
    if scene.floor.rest_speed:
        return f"{law} At an impact slower than {number(scene.floor.rest_speed)} m/s, e is 0; after it the body lies still."
    if scene.floor.restitution == 1.0:
        return law
    return f"""{law} The times of the impacts converge to t = t₁ + (2 |v₁|/|g_y|) e/(1 - e), where t₁ is the time of the first impact and v₁
        the velocity before it. From then on, the body lies still."""


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
    rows["gravity"] = _gravity(scene)
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


def _gravity(scene):
    if scene.gravity is None:
        return "none (g = 0)"
    gx, _, gz = scene.gravity.acceleration
    slope = "; its horizontal part represents the slope of the floor" if scene.floor is not None and (gx or gz) else ""
    return f"g = {vector(scene.gravity.acceleration)} m/s²{slope}"


def _shape(body):
    if body.shape == "sphere":
        return f"ball of radius {number(body.radius)} m, centre of mass at its centre"
    if body.shape == "box":
        at = f"{vector(body.centre)} m from its centre" if body.centre.any() else "at its centre"
        return f"box with the half extents {vector(body.half_extents)} m along its axes, centre of mass {at}"
    count = f"{len(body.vertices)} points"
    if len(body.vertices) > MOST_POINTS:
        given = "given in the file beside the scene file, here relative to their centre of mass"
        return f"a mesh of {count}, {given}; only these points touch the planes"
    points = ", ".join(vector(point, computed) for point in body.vertices)
    return f"the convex hull of {count}, whose positions relative to the centre of mass are, in m: {points}"


def _inertia(body):
    tensor = body.inertia_tensor
    rows = vector(np.diag(tensor), computed) if is_diagonal(tensor) else ", ".join(vector(row, computed) for row in tensor)
    about = "principal moments about the axes of the body frame" if is_diagonal(tensor) else "tensor in the body frame, by rows"
    why = {"solid": "; homogeneous body", "vertices": "; equal point masses at the corners"}.get(
        str(body.inertia), "; given, not computed from the shape"
    )
    return f"{about}: {rows} kg m²{why}"


def _floor(floor):
    named = {"none": "no friction", "infinite": "infinite friction"}
    friction = named.get(str(floor.friction)) or f"Coulomb friction f = {number(floor.friction)}"
    return f"the plane y = 0, fixed; restitution e = {number(floor.restitution)}, {friction}"


def _ensemble(scene):
    one = scene.ensemble
    return (
        f"the scene also has {one.size} random initial states (seed {one.seed}): orientations are uniform over all rotations, angular "
        f"velocities are uniform within ± {vector(one.angular_velocity)} rad/s of the ω above, and the lowest point is as high as in the "
        "initial state above; this sheet solves only the initial state above"
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

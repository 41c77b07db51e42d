"""The polhode: the path of the angular velocity in the body frame.

    2 T = I₁ω₁² + I₂ω₂² + I₃ω₃²,   L² = I₁²ω₁² + I₂²ω₂² + I₃²ω₃²

A free body conserves both, so its ω moves along the intersection of the two ellipsoids.

Source: L. D. Landau & E. M. Lifshitz, Mechanics, section 37.
"""

from itertools import product
from typing import Any

import numpy as np

from comparisons.results.results import Results
from reports.plots.style import Array, at_one_step, exact_motion, exact_style, ink, thinned
from scenarios import DropspinError, Scenario, Trajectory, truth_for
from scenarios.rotations import cross, unrotate

FARTHEST = 1.6
"""A path is drawn up to this multiple of the half axes, so that the ellipsoid does not become too small to see."""
FLATTEST = 0.4
"""Least length of the shortest half axis in the picture, relative to the longest."""
NEARLY_PARALLEL = 1e-9
"""A body whose ω and L enclose an angle with a smaller sine counts as spinning about a principal axis."""
VIEWS = tuple(product((-40, -20, 20, 40), range(-165, 180, 30)))
"""Elevations and azimuths [degrees], none along an axis."""
LABEL_POSITIONS, CLEARANCE = (1.35, 1.6, 1.9, 2.2), 0.12
"""Possible positions of the name of a half axis, as multiples of it; its least distance from any path, relative to the largest extent."""
SUBSCRIPTS = "₁₂₃"


@np.errstate(all="ignore")  # an engine may return 1e300
def plot_polhode(results: Results, scene_name: str, axes: Any) -> None:
    """Draw the path of the angular velocity in the body frame, on the energy ellipsoid of the start.

    Engines are drawn at the coarsest time step, with the exact solution.

    A marker shows the end of each path. Without a gyroscopic term the path is a point; with an explicit one it leaves the ellipsoid.

    Args:
        results: The run.
        scene_name: One of its scenes; it must start with a spin.
        axes: The axes to draw into, made with `projection="3d"`.

    Raises:
        DropspinError: The scene starts without spin.
    """
    scene = results.scenes[scene_name]
    half_axes = energy_ellipsoid(scene)
    if not half_axes.any():
        raise DropspinError(f"{scene_name} starts without spin: its polhode is a point; choose a scene with start.angular_velocity.")
    _draw_ellipsoid(half_axes, axes)
    paths = []
    for motion, style in at_one_step(results, results.trajectories, scene_name, max, least_marker=5.0):
        paths.append(_in_sight(principal_spin(scene, thinned(motion)), half_axes))
        axes.plot(*paths[-1].T, markevery=[-1], **style)
    truth = truth_for(scene)
    if truth is not None:
        paths.append(principal_spin(scene, exact_motion(scene, truth)))
        axes.plot(*paths[-1].T, **exact_style())
    _frame(half_axes, paths, axes)


def principal_spin(scene: Scenario, motion: Trajectory) -> Array:
    """Angular velocity along the principal axes of the body, least moment first [rad/s], shape (n, 3)."""
    return unrotate(motion.orientation, motion.angular_velocity) @ _principal(scene)[1]


def energy_ellipsoid(scene: Scenario) -> Array:
    """Half axes √(2 T / I) of the ellipsoid of the angular velocities with the rotational energy T of the start [rad/s], shape (3,)."""
    moments, _ = _principal(scene)
    half_axes: Array = np.sqrt(moments @ _start(scene) ** 2 / moments)
    return half_axes


def wobbles_freely(scene: Scenario) -> bool:
    """Whether the angular velocity moves in the body frame: it is not parallel to the angular momentum, up to rounding."""
    start = _start(scene)
    momentum = _principal(scene)[0] * start
    torque = np.linalg.norm(cross(momentum, start))
    return bool(torque > NEARLY_PARALLEL * np.linalg.norm(momentum) * np.linalg.norm(start))


def facing(path: Array, half_axes: Array) -> tuple[int, int]:
    """The view in `VIEWS` that shows most of a path on an ellipsoid: on the near side and not foreshortened.

    Length counts, not time: a body that flips stays longest where the path is short.

    Args:
        path: Angular velocities [rad/s], shape (n, 3).
        half_axes: Half axes of the ellipsoid [rad/s], shape (3,).

    Returns:
        Elevation and azimuth [degrees].
    """
    steps, middles = np.diff(path, axis=0), 0.5 * (path[1:] + path[:-1])
    speck = 1e-9 * float(half_axes.max())  # so that a path that is a point is on the near side too
    lengths = np.linalg.norm(steps, axis=1) + speck
    scores = []
    for view in VIEWS:
        towards = _towards(view)
        near = lengths @ (middles / half_axes**2 @ towards > 0.0)
        seen = np.linalg.norm(cross(steps, towards), axis=1).sum() + speck
        scores.append(near * seen)
    return VIEWS[int(np.argmax(scores))]


def _principal(scene: Scenario) -> tuple[Array, Array]:
    """Principal moments of inertia, least first [kg m²], and their axes in the body frame, the columns of a right-handed triad."""
    moments, axes = np.linalg.eigh(scene.body.inertia_tensor)
    return moments, axes * np.linalg.det(axes)


def _start(scene: Scenario) -> Array:
    return principal_spin(scene, Trajectory.from_states(np.zeros(1), scene.initial_state[None]))[0]


def _in_sight(path: Array, half_axes: Array) -> Array:
    """The path up to the first point farther than `FARTHEST` from the ellipsoid."""
    is_far = ~(np.linalg.norm(path / half_axes, axis=1) <= FARTHEST)
    return path[: int(np.argmax(is_far))] if is_far.any() else path


def _draw_ellipsoid(half_axes: Array, axes: Any) -> None:
    longitude, latitude = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 25), np.linspace(0.0, np.pi, 13))
    ball = np.array([np.cos(longitude) * np.sin(latitude), np.sin(longitude) * np.sin(latitude), np.cos(latitude)])
    axes.plot_wireframe(*(half_axes[:, None, None] * ball), color=ink(), alpha=0.15, linewidth=0.5, rstride=2, cstride=2)


def _frame(half_axes: Array, paths: list[Array], axes: Any) -> None:
    """Set the view and the limits; label the half axes on the near side instead of axes with ticks, which would overlap."""
    if paths and len(paths[-1]) > 1:
        axes.view_init(*facing(paths[-1], half_axes))
    drawn = np.vstack([half_axes, *(np.abs(path) for path in paths)]).max(axis=0)
    towards = _towards((axes.elev, axes.azim))
    near = np.where(towards < 0.0, -1.0, 1.0)
    for number, tip in enumerate(np.diag(near * half_axes)):
        position = _label_position(np.vstack(paths), tip, towards) if paths else LABEL_POSITIONS[0] * tip
        axes.plot(*np.array([tip, 0.9 * position]).T, color=ink(), linewidth=0.8)
        axes.text(*position, f"{'−' if near[number] < 0.0 else ''}ω{SUBSCRIPTS[number]}", ha="center", va="center")
    axes.text2D(0.5, -0.1, "half axes {:.3g}, {:.3g}, {:.3g} rad/s".format(*half_axes), ha="center", transform=axes.transAxes)
    axes.set(xlim=(-drawn[0], drawn[0]), ylim=(-drawn[1], drawn[1]), zlim=(-drawn[2], drawn[2]))
    axes.set_box_aspect(np.maximum(drawn, FLATTEST * drawn.max()), zoom=1.25)
    axes.set_axis_off()


def _label_position(points: Array, tip: Array, towards: Array) -> Array:
    """The first position along a half axis where its name hides none of the points in this view; the last if there is none."""
    for multiple in LABEL_POSITIONS:
        offsets = points - multiple * tip
        distances = np.linalg.norm(offsets - (offsets @ towards)[:, None] * towards, axis=1)
        if distances.min() > CLEARANCE * np.linalg.norm(points, axis=1).max():
            break
    position: Array = multiple * tip
    return position


def _towards(view: tuple[float, float]) -> Array:
    """The direction towards the viewer, from an elevation and an azimuth [degrees]."""
    elevation, azimuth = np.radians(view)
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])

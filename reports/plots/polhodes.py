"""The polhode: the path of the angular velocity in the body frame.

    2 T = I₁ω₁² + I₂ω₂² + I₃ω₃²,   L² = I₁²ω₁² + I₂²ω₂² + I₃²ω₃²

A free body conserves both, so its ω moves along the intersection of the two ellipsoids.

Source: L. D. Landau & E. M. Lifshitz, Mechanics, section 37.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from dropspin.comparisons.results.results import Results
from dropspin.reports.plots.chart import Chart, Line, draw
from dropspin.reports.plots.style import MOST_POINTS, at_one_step, stride
from dropspin.scenarios import DropspinError, Scenario, Trajectory, truth_for
from dropspin.scenarios.rotations import unrotate
from dropspin.scenarios.state import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FARTHEST = 1.6
"""A path is drawn up to this multiple of the half axes, so that the ellipsoid stays visible."""
FLATTEST = 0.4
"""Smallest length of the shortest half axis in the plot, relative to the longest."""
TOWARDS = np.array([0.48, 0.6, 0.64])
"""The direction towards the viewer, but for the signs, which are those of the middle of the path."""
LABEL_POSITION = 1.2
"""Position of the label of a half axis, as a multiple of its length."""
LATITUDES, LONGITUDES = np.radians([-60.0, -30.0, 0.0, 30.0, 60.0]), np.radians([0.0, 30.0, 60.0, 90.0, 120.0, 150.0])
GREY = "#8C8C8C"
SUBSCRIPTS = "₁₂₃"


def polhode(results: Results, scene_name: str) -> Chart:
    """The path of the angular velocity in the body frame, on the energy ellipsoid of the initial state.

    The plot shows each engine at the largest time step, and the exact solution. A marker shows the end of each path. Without a gyroscopic
    term the path is a point; with an explicit gyroscopic term it leaves the ellipsoid.

    Args:
        results: The run.
        scene_name: The name of a scene of the run, with an initial angular velocity.

    Raises:
        DropspinError: The initial angular velocity of the scene is 0.
    """
    half_axes = energy_ellipsoid(results.scenes[scene_name])
    if not half_axes.any():
        raise DropspinError(f"{scene_name} has no initial angular velocity, so it has no polhode; set start.angular_velocity.")
    paths = polhode_paths(results, scene_name)
    reference = paths[-1][0] if paths else half_axes[None]
    towards = np.where(reference.mean(axis=0) < 0.0, -TOWARDS, TOWARDS)
    right = np.cross([0.0, 0.0, 1.0], towards) / np.hypot(*towards[:2])
    drawn = np.vstack([half_axes, *(np.abs(path) for path, _ in paths)]).max(axis=0)
    screen = np.array([right, np.cross(towards, right)]) * np.maximum(1.0, FLATTEST * drawn.max() / drawn)  # a flat ellipsoid is stretched
    x, y = screen @ _wireframe(half_axes).T
    lines = [Line("energy ellipsoid", x, y, GREY, 0.5)]
    for path, style in paths:
        x, y = screen @ path.T
        lines.append(Line(x=x, y=y, **style | {"marker": "", "is_sparse": False}))
        if style.get("marker"):
            lines.append(Line(x=x[-1:], y=y[-1:], **style | {"width": 0.0, "is_sparse": False}))
    signs = np.sign(towards)
    ends = (screen * LABEL_POSITION * signs * half_axes).T.tolist()
    texts = [(x, y, f"{'−' if sign < 0.0 else ''}ω{subscript}") for (x, y), sign, subscript in zip(ends, signs, SUBSCRIPTS, strict=True)]
    remark = "Half axes of the energy ellipsoid: {:.3g}, {:.3g}, {:.3g} rad/s.".format(*half_axes)
    return Chart("", "", lines, is_map=True, texts=texts, remark=remark)


@np.errstate(all="ignore")  # an engine may return 1e300
def polhode_paths(results: Results, scene_name: str) -> list[tuple[Array, dict[str, Any]]]:
    """The angular velocity along the principal axes [rad/s], shape (n, 3), of the engines and of the exact solution, with line styles."""
    scene = results.scenes[scene_name]
    half_axes, truth = energy_ellipsoid(scene), truth_for(scene)
    paths = [
        (_in_sight(principal_spin(scene, motion[:: stride(len(motion))]), half_axes), style)
        for motion, style in at_one_step(results, results.trajectories, scene_name, max)
    ]
    if truth is not None:
        exact = truth(np.linspace(0.0, min(scene.duration, truth.horizon), MOST_POINTS))
        paths.append((principal_spin(scene, exact), {"label": truth.word, "width": 1.0, "dashes": "dashed"}))
    return paths


def plot_polhode(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw `polhode` into axes."""
    draw(polhode(results, scene_name), axes)


def principal_spin(scene: Scenario, motion: Trajectory) -> Array:
    """Angular velocity along the principal axes of the body, smallest moment first [rad/s], shape (n, 3)."""
    return unrotate(motion.orientation, motion.angular_velocity) @ _principal(scene)[1]


def energy_ellipsoid(scene: Scenario) -> Array:
    """Half axes √(2 T / I) of the ellipsoid of angular velocities that have the initial rotational energy T [rad/s], shape (3,)."""
    (moments, _), start = _principal(scene), Trajectory.from_states(np.zeros(1), scene.initial_state[None])
    return np.sqrt(moments @ principal_spin(scene, start)[0] ** 2 / moments)


def _principal(scene: Scenario) -> tuple[Array, Array]:
    """Principal moments of inertia, smallest first [kg m²], and their axes in the body frame, as columns of a right-handed triad."""
    moments, axes = np.linalg.eigh(scene.body.inertia_tensor)
    return moments, axes * np.linalg.det(axes)


def _in_sight(path: Array, half_axes: Array) -> Array:
    """The path up to the first point farther than `FARTHEST` from the ellipsoid."""
    is_far = ~(np.linalg.norm(path / half_axes, axis=1) <= FARTHEST)
    return path[: int(np.argmax(is_far))] if is_far.any() else path


def _wireframe(half_axes: Array) -> Array:
    """Circles of latitude and longitude on the ellipsoid, with NaN between them, shape (n, 3)."""
    around, gap = np.linspace(0.0, 2.0 * np.pi, 49), np.full((1, 3), np.nan)
    circles = [np.stack([np.cos(around) * np.cos(at), np.sin(around) * np.cos(at), np.full(49, np.sin(at))], axis=1) for at in LATITUDES]
    circles += [np.stack([np.sin(around) * np.cos(at), np.sin(around) * np.sin(at), np.cos(around)], axis=1) for at in LONGITUDES]
    return half_axes * np.concatenate([part for circle in circles for part in (circle, gap)])

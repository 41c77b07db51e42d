"""A replay as an animated GIF or an MP4 video."""

import math
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dropspin.comparisons.engines.packages import install_extra
from dropspin.comparisons.results.complete_folders import written_whole
from dropspin.reports.plots.colours import human_label
from dropspin.reports.replay.motions import Motion, Replay
from dropspin.scenarios import DropspinError
from dropspin.scenarios.bodies.outline import Outline
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import Array
from dropspin.scenarios.surfaces import Wall

if TYPE_CHECKING:
    from matplotlib.animation import AbstractMovieWriter
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D


FRAME_RATE = 25
"""Frames per second."""
MOST_FRAMES = 5000
MERIDIANS = 24
"""Number of meridians of a drawn sphere."""
MARK = 0.72
"""Share of white in the colour of the marked face of a body."""
ZOOM = 1.2
"""Size of the view relative to that of matplotlib, which leaves room for axes that are not drawn."""
EXACT_COLOUR = "#202428"
"""Colour of the exact solution, which is drawn dashed."""


def write_clip(replay: Replay, file: str | Path, speed: float, on_progress: Callable[[float], None] = lambda _: None) -> None:
    """Write an animated GIF or an MP4 video of a scene, the first engine filled, the others as outlines, the exact solution dashed.

    Args:
        replay: The scene.
        file: The file to write; its name ends in `.gif` or `.mp4`.
        speed: Seconds of the scene per second of the film.
        on_progress: Called after each frame with the fraction of frames drawn.

    Raises:
        DropspinError: There would be too many frames, no encoder is installed, or the file cannot be written. An earlier file of this name
            stays unchanged.
    """
    from matplotlib.figure import Figure

    times, writer = _frame_times(replay, speed), _writer(file)
    figure = Figure(figsize=(5.6, 4.2), dpi=100)
    axes = _add_axes(figure, replay)
    shape = replay.scene.body.outline
    title = figure.suptitle("")
    with written_whole(file) as unfinished:
        writer.setup(figure, str(unfinished), 100)  # its own context manager would encode all frames after an interrupt, too
        for number, time in enumerate(times):
            title.set_text(f"{replay.scene.name}, {time:.3f} s")
            drawn = [artist for motion in replay.motions for artist in _draw(axes, shape, replay, motion, time)]
            writer.grab_frame()
            for artist in drawn:
                artist.remove()
            on_progress((number + 1) / len(times))
        writer.finish()


def _writer(file: str | Path) -> "AbstractMovieWriter":
    """The encoder of a file, by the ending of its name."""
    from matplotlib import rcParams
    from matplotlib.animation import FFMpegWriter, PillowWriter

    if Path(file).suffix.lower() != ".mp4":
        return PillowWriter(fps=FRAME_RATE)
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ImportError:
        raise DropspinError(f"{file}: MP4 files need a package that is not installed: {install_extra('mp4')}.") from None
    rcParams["animation.ffmpeg_path"] = get_ffmpeg_exe()
    return FFMpegWriter(fps=FRAME_RATE, codec="libx264", extra_args=["-pix_fmt", "yuv420p", "-f", "mp4"])  # as all players take it


def _frame_times(replay: Replay, speed: float) -> Array:
    """Times of the scene at which frames are drawn [s], shape (frames,)."""
    duration = max(float(motion.frames.t[-1]) for motion in replay.motions)
    slowest = duration * FRAME_RATE / MOST_FRAMES
    if not slowest <= speed < math.inf:
        raise DropspinError(
            f"a film at a speed of {speed:g} has more than {MOST_FRAMES:,} frames; choose a speed of at least {slowest:.2g}."
        )
    return np.arange(0.0, duration + 1e-9, speed / FRAME_RATE)


def _add_axes(figure: "Figure", replay: Replay) -> "Axes3D":
    """Add axes that show every motion, y up, with the floor, the walls and a legend."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    axes: Axes3D = figure.add_axes((0.0, 0.08, 1.0, 0.84), projection="3d", computed_zorder=False)
    size = replay.scene.body.size
    positions = np.concatenate([motion.frames.position for motion in replay.motions])
    positions = positions[replay.in_sight(positions)]
    low, high = positions.min(axis=0) - size, positions.max(axis=0) + size
    x, y, z = zip(low, high, strict=True)
    axes.set(xlim=x, ylim=(-z[1], -z[0]), zlim=y)
    axes.set_box_aspect((x[1] - x[0], z[1] - z[0], y[1] - y[0]), zoom=ZOOM)
    axes.view_init(elev=12.0, azim=-60.0)
    axes.set_axis_off()
    if replay.scene.floor is not None:
        across, along = np.meshgrid(np.linspace(*x, 9), np.linspace(-z[1], -z[0], 9))
        axes.plot_wireframe(across, along, np.zeros_like(across), color=EXACT_COLOUR, alpha=0.2, linewidth=0.7)
    walls = [_y_up(_in_box(wall, low, high)) for wall in replay.scene.wall or ()]
    axes.add_collection3d(Poly3DCollection(walls, facecolor=EXACT_COLOUR, edgecolor=EXACT_COLOUR, alpha=0.1))
    lines = [(human_label(motion.label), motion.colour or EXACT_COLOUR, "-" if motion.colour else "--") for motion in replay.motions]
    handles = [axes.plot([], [], [], color=colour, linestyle=style, label=label)[0] for label, colour, style in lines]
    figure.legend(handles=handles, loc="lower center", ncols=len(handles), frameon=False, fontsize=9)
    return axes


def _in_box(wall: Wall, low: Array, high: Array) -> Array:
    """The corners of the part of a wall that is in a box, in order around it, shape (n, 3); none if it is outside."""
    corners = np.array(list(product(*zip(low, high, strict=True))))
    heights = (corners - wall.point) @ np.array(wall.normal)
    edges = [(i, i | bit) for bit in (1, 2, 4) for i in range(8) if not i & bit]
    crossed = [(i, j) for i, j in edges if (heights[i] < 0.0) != (heights[j] < 0.0)]
    points = np.array([(heights[i] * corners[j] - heights[j] * corners[i]) / (heights[i] - heights[j]) for i, j in crossed]).reshape(-1, 3)
    x, _, z = rotate(wall.frame, points - points.mean(axis=0)).T if len(points) else np.empty((3, 0))
    return points[np.argsort(np.arctan2(z, x))]


def _draw(axes: "Axes3D", shape: Outline, replay: Replay, motion: Motion, time: float) -> list[Any]:
    """Draw the body and its trail at a time [s], unless its motion has ended or the body is out of the view."""
    from matplotlib.colors import to_rgb
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    if time > motion.frames.t[-1] + 1e-9:
        return []
    frame = int(np.searchsorted(motion.frames.t, time + 1e-9, side="right")) - 1
    position, orientation = motion.frames.position[frame], motion.frames.orientation[frame]
    if not replay.in_sight(position[None])[0]:
        return []
    local = shape.polygons(MERIDIANS)
    faces = [_y_up(position + rotate(orientation, face)) for face in local]
    style: dict[str, Any] = {"facecolor": "none", "edgecolor": motion.colour or EXACT_COLOUR, "linestyle": "-" if motion.colour else "--"}
    if motion is replay.motions[0] and motion.colour:
        # As in the page, the face along the body's axis z is light.
        marked = [] if shape.radius else [np.argmax([face[:, 2].min() for face in local])]
        colours = np.tile(to_rgb(motion.colour), (len(local), 1))
        colours[marked] += MARK * (1.0 - colours[marked])
        style = {"facecolors": colours, "edgecolor": EXACT_COLOUR}
    trail = _y_up(np.vstack([motion.frames.position[motion.frames.t <= time], position]))
    [line] = axes.plot(*trail.T, color=motion.colour or EXACT_COLOUR, linewidth=0.8, alpha=0.6)
    return [axes.add_collection3d(Poly3DCollection(faces, linewidth=0.7, **style)), line]


def _y_up(points: Array) -> Array:
    """Points in matplotlib's axes, whose third coordinate is up."""
    return points[:, [0, 2, 1]] * [1.0, -1.0, 1.0]

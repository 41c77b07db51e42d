"""A replay as a clip: an animated GIF, or a video."""

import math
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reports.replay.bodies import Outline, outline
from reports.replay.motions import Motion, Replay
from scenarios import DropspinError
from scenarios.rotations import rotate

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

Array = NDArray[np.float64]

FRAMES_A_SECOND = 25
MOST_FRAMES = 5000
ROUND = 24
"""Meridians of a ball."""
GHOST = "#202428"


def write_clip(replay: Replay, file: str | Path, speed: float, progress: Callable[[float], None] = lambda _: None) -> None:
    """Write a clip of a scene, engines overlaid, the truth as a ghost.

    Args:
        replay: The scene.
        file: Where to; `.gif`, or `.mp4`, which needs imageio-ffmpeg.
        speed: Seconds of the scene in a second of the clip.
        progress: Told the share that is drawn.

    Raises:
        DropspinError: The file's ending is another, imageio-ffmpeg is missing, the clip would be too long, or the file cannot be written.
            What there was before is there still.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    writer, settings = _writer(Path(file))
    lasts = max(len(motion.frames) - 1 for motion in replay.motions) * replay.interval
    slowest = lasts * FRAMES_A_SECOND / MOST_FRAMES
    if not slowest <= speed < math.inf:
        raise DropspinError(f"a clip at a speed of {speed:g} has more than {MOST_FRAMES:,} frames; choose one of at least {slowest:.2g}.")
    times = np.arange(0.0, lasts + 1e-9, speed / FRAMES_A_SECOND)
    figure = Figure(figsize=(6.4, 4.8), dpi=100)
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    _frame(axes, replay)
    shape = outline(replay.scene.body)
    title = figure.suptitle("")
    handles = [axes.plot([], [], [], color=motion.colour or GHOST, label=motion.label)[0] for motion in replay.motions]
    figure.legend(handles=handles, loc="lower center", ncols=len(handles), frameon=False, fontsize=9)
    try:
        with tempfile.TemporaryDirectory(prefix=".unfinished-", dir=Path(file).parent) as folder:
            unfinished = Path(folder) / Path(file).name
            with rc_context(settings), writer.saving(figure, str(unfinished), 100):
                for number, time in enumerate(times):
                    title.set_text(f"{replay.scene.name}, {time:.3f} s")
                    drawn = [artist for motion in replay.motions for artist in _drawn(axes, shape, replay, motion, time / replay.interval)]
                    writer.grab_frame()
                    for artist in drawn:
                        artist.remove()
                    progress((number + 1) / len(times))
            unfinished.replace(file)
    except OSError as error:
        raise DropspinError(f"{file}: cannot be written: {error.strerror or error}; choose another place.") from None


def _writer(file: Path) -> tuple[Any, Any]:
    """What writes a kind of file, and the settings it needs."""
    from matplotlib.animation import FFMpegWriter, PillowWriter

    if file.suffix.lower() == ".gif":
        return PillowWriter(fps=FRAMES_A_SECOND), {}
    if file.suffix.lower() != ".mp4":
        raise DropspinError(f"{file}: a clip is a .gif or an .mp4; give the file one of these endings.")
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ImportError:
        raise DropspinError(f"{file}: a video needs imageio-ffmpeg: pip install 'dropspin[video]'; or write a .gif.") from None
    try:
        program = get_ffmpeg_exe()
    except RuntimeError:
        program = ""
    if shutil.which(program) is None:
        raise DropspinError(f"{file}: there is no ffmpeg that can be run at {program!r}; set IMAGEIO_FFMPEG_EXE to one, or write a .gif.")
    return FFMpegWriter(fps=FRAMES_A_SECOND), {"animation.ffmpeg_path": program}


def _frame(axes: "Axes3D", replay: Replay) -> None:
    """ResourceLimits that hold all of every motion, with our y up; a floor."""
    size = replay.scene.body.size
    places = np.concatenate([motion.frames.position for motion in replay.motions])
    places = places[replay.in_sight(places)]
    low, high = places.min(axis=0) - size, places.max(axis=0) + size
    x, y, z = zip(low, high, strict=True)
    axes.set(xlim=x, ylim=(-z[1], -z[0]), zlim=y)
    axes.set_aspect("equal")
    axes.view_init(elev=12.0, azim=-60.0)
    axes.set_axis_off()
    if replay.scene.floor is not None:
        across, along = np.meshgrid(np.linspace(*x, 9), np.linspace(-z[1], -z[0], 9))
        axes.plot_wireframe(across, along, np.zeros_like(across), color=GHOST, alpha=0.2, linewidth=0.7)


def _drawn(axes: "Axes3D", shape: Outline, replay: Replay, motion: Motion, place: float) -> list[Any]:
    """A body where it is now, and its way there; nothing once its motion has ended, or has left the view."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    if place > len(motion.frames) - 1 + 1e-6:
        return []
    position, orientation = motion.pose(place)
    if not replay.in_sight(position[None])[0]:
        return []
    faces = [_upright(position + rotate(orientation, face)) for face in _faces(shape)]
    look: dict[str, Any] = {"facecolor": motion.colour, "alpha": 0.55, "edgecolor": motion.colour}
    if not motion.colour:
        look = {"facecolor": "none", "edgecolor": GHOST, "linestyle": "--"}
    trail = _upright(np.vstack([motion.frames.position[: int(place) + 1], position]))
    [line] = axes.plot(*trail.T, color=motion.colour or GHOST, linewidth=0.8, alpha=0.6)
    return [axes.add_collection3d(Poly3DCollection(faces, linewidth=0.7, **look)), line]


def _faces(shape: Outline) -> list[Array]:
    """Polygons of a surface, in the body's frame [m]."""
    if not shape.radius:
        return [shape.vertices[list(face)] for face in shape.faces]
    around, down = np.linspace(0.0, 2.0 * np.pi, ROUND + 1), np.linspace(0.0, np.pi, ROUND // 2 + 1)
    grid = shape.radius * np.stack(
        [np.outer(np.sin(down), np.cos(around)), np.outer(np.cos(down), np.ones_like(around)), np.outer(np.sin(down), np.sin(around))],
        axis=-1,
    )
    return [grid[[i, i + 1, i + 1, i], [j, j, j + 1, j + 1]] for i in range(0, len(down) - 1, 2) for j in range(0, len(around) - 1, 4)]


def _upright(points: Array) -> Array:
    """In matplotlib's axes, whose third is up."""
    return points[:, [0, 2, 1]] * [1.0, -1.0, 1.0]

"""Measured tosses of a cube, which a user has, simulated as a source simulated them with several engines; the errors as it defines them.

Source: B. Acosta, W. Yang, M. Posa, Validating Robotics Simulators on Real-World Impacts, IEEE RA-L 7(3), 2022, and its programs.
"""

import io
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dropspin.comparisons.published.results import SHOWN, Result, with_value
from dropspin.comparisons.published.sources import Source
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios import DropspinError
from dropspin.scenarios.files import read_file
from dropspin.scenarios.rotations import angle_between_orientations, length, rotate, rotation_vector
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array

COLUMNS = 19
LARGEST_FILE = 1_000_000  # bytes
BEFORE_CONTACT = 3
"""Frames from the start of a simulation to the one at which the centre is as low as a corner can reach."""
Cube = Mapping[str, Any]
"""The numbers that all runs share: tosses, rate [1/s], substeps, half_side [m], mass [kg], inertia [kg m²] and gravity [m/s²]."""
Run = Mapping[str, Any]
"""One run: tool, by (the engine), case, stiffness and damping of the contact, friction, printed (digits by quantity), why_not."""


def read_tosses(folder: Path, cube: Cube) -> list[Array]:
    """The tosses from their starts on: states, z up, angular velocities in the world frame; shape (n, 13) each."""
    return [from_start(_states(folder / f"{number}.pt", cube["half_side"]), cube) for number in range(cube["tosses"])]


def _states(file: Path, half_side: float) -> Array:
    """The states of a file of PyTorch, a ZIP archive with the numbers in one member: lengths over `half_side`, quaternions [w, x, y, z]."""
    raw = read_file(file, str(file), "toss", LARGEST_FILE)
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            [member] = [name for name in archive.namelist() if "/data/" in name]
            rows = np.frombuffer(archive.read(member)).reshape(-1, COLUMNS)
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError) as error:  # also for an encrypted file
        raise DropspinError(f"{file}: is not a toss: {error}; give the folder of the cleaned tosses.") from None
    orientation = np.roll(rows[:, 3:7], -1, axis=1)
    spin = rotate(orientation, rows[:, 10:13])
    return np.hstack([half_side * rows[:, :3], orientation, half_side * rows[:, 7:10], spin])


def from_start(states: Array, cube: Cube) -> Array:
    """A toss from three frames before the first contact is possible; its start is fitted to the frames before, if there are four.

    Horizontal velocities are differences of the first and the last of these frames, the vertical one is of the nearest parabola, and the
    angular velocity is that of the rotation from the first frame to the start.
    """
    low = states[:, 2] <= np.sqrt(3.0) * cube["half_side"]
    start = max(int(np.argmax(low)) - BEFORE_CONTACT, 0)
    if start < BEFORE_CONTACT + 1:
        return states[start:]
    t, position = np.arange(start) / cube["rate"], states[:start, POSITION]
    design = np.column_stack([np.ones(start), t])
    _, upward = np.linalg.lstsq(design, position[:, 2] + 0.5 * cube["gravity"] * t**2, rcond=None)[0]
    first, here = states[0, ORIENTATION], states[start, ORIENTATION]
    fitted = states[start:].copy()
    fitted[0, VELOCITY] = (position[-1] - position[0]) / t[-1]
    fitted[0, VELOCITY][2] = upward - cube["gravity"] * t[-1]
    fitted[0, SPIN] = rotation_vector(first, here) / (start / cube["rate"])
    return fitted


def errors(poses: list[Array], tosses: list[Array], half_side: float) -> dict[str, float]:
    """The loss and the mean errors of simulated poses, (n, 7) for each toss: means over the frames, then over the tosses."""
    distances = [length(pose[:, POSITION] - toss[:, POSITION]) for pose, toss in zip(poses, tosses, strict=True)]
    angles = [angle_between_orientations(pose[:, ORIENTATION], toss[:, ORIENTATION]) for pose, toss in zip(poses, tosses, strict=True)]
    position = np.array([50.0 * distance.mean() / half_side for distance in distances])
    rotation = np.degrees([angle.mean() for angle in angles])
    losses = [np.mean(distance**2) / half_side + np.mean(angle**2) for distance, angle in zip(distances, angles, strict=True)]
    return {
        "loss": float(np.mean(losses)),
        "position [% of the side]": float(position.mean()),
        "position, standard deviation": float(position.std()),
        "rotation [°]": float(rotation.mean()),
        "rotation, standard deviation": float(rotation.std()),
    }


def acosta_cube(source: Source, folder: str, processes: EngineProcesses) -> list[Callable[[], Iterator[Result]]]:
    """Functions that give the published errors beside those of the same runs here, run by run."""
    tosses = read_tosses(Path(folder), source.parameters["cube"])
    return [partial(_of_run, source, run, tosses, processes) for run in source.parameters["runs"]]


def _of_run(source: Source, run: Run, tosses: list[Array], processes: EngineProcesses) -> Iterator[Result]:
    why_not = run.get("why_not", "")
    entry = engine_entry(run["by"]) if run["by"] else EngineEntry("", None, "missing", why_not)
    values = processes.call(entry, _simulated, source.parameters["cube"], run, tosses)
    for quantity, printed in run["printed"].items():
        value = values if isinstance(values, Breakdown) else values[quantity]
        result = Result(source.name, run["tool"], f"{run['case']}: {quantity}", printed, "", run["by"], "not run")
        result = with_value(result, value, why_not)
        if why_not and not isinstance(value, Breakdown):
            result = replace(result, here=f"{value:.{SHOWN}g}", status="not reproducible", reason=why_not)
        yield result


def _simulated(entry: EngineEntry, cube: Cube, run: Run, tosses: list[Array]) -> dict[str, float]:
    """The errors of a run; runs in the engine's process."""
    return errors(SIMULATIONS[entry.adapter.name](cube, run, tosses), tosses, cube["half_side"])


CUBE_URDF = """<robot name="cube"><link name="cube"><inertial><mass value="{mass}"/>
<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="{side} {side} {side}"/></geometry></collision></link></robot>"""
BOARD_URDF = """<robot name="board"><link name="board"><contact><lateral_friction value="1"/></contact><inertial><mass value="0"/>
<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 -0.5"/><geometry><box size="5 5 1"/></geometry></collision></link></robot>"""
MJCF = """<mujoco><option timestep="{dt}" gravity="0 0 -{gravity}"><flag refsafe="disable"/></option><worldbody>
<body><inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/><freejoint/>
<geom type="box" size="{half_side} {half_side} {half_side}" friction="{friction} 0.001 0.001"/></body>
<geom type="box" size="5 5 0.2" pos="0 0 -0.2" solref="-{stiffness} -{damping}" friction="{friction} 0.001 0.001"/></worldbody></mujoco>"""


def _pybullet(cube: Cube, run: Run, tosses: list[Array]) -> list[Array]:
    """Poses [position, x, y, z, w] of every frame. As in the source, the bodies are loaded from URDF, anew for each toss."""
    from dropspin.comparisons.engines.pybullet_simulation import Connection

    server, poses = Connection(), []
    with tempfile.TemporaryDirectory() as folder:
        texts = {"cube": CUBE_URDF.format(**cube, side=2.0 * cube["half_side"]), "board": BOARD_URDF}
        for name, text in texts.items():
            Path(folder, name).with_suffix(".urdf").write_text(text, encoding="utf-8")
        for toss in tosses:
            server.resetSimulation()
            server.setGravity(0.0, 0.0, -cube["gravity"])
            body, board = server.loadURDF(f"{folder}/cube.urdf"), server.loadURDF(f"{folder}/board.urdf", useFixedBase=True)
            contact = {"contactStiffness": run["stiffness"], "contactDamping": run["damping"], "lateralFriction": run["friction"]}
            server.changeDynamics(board, -1, **contact)
            server.setTimeStep(1.0 / (cube["rate"] * cube["substeps"]))
            server.resetBasePositionAndOrientation(body, toss[0, POSITION], toss[0, ORIENTATION])
            server.resetBaseVelocity(body, toss[0, VELOCITY], toss[0, SPIN])
            parts = [server.states_after_each(body, steps, count) for steps, count in ((0, 1), (cube["substeps"], len(toss) - 1))]
            poses.append(np.concatenate(parts)[:, :7])
    return poses


def _mujoco(cube: Cube, run: Run, tosses: list[Array]) -> list[Array]:
    """Poses [position, x, y, z, w] of every frame."""
    import mujoco

    from dropspin.comparisons.engines.mujoco_simulation import from_world

    model = mujoco.MjModel.from_xml_string(MJCF.format(**cube, **run, dt=1.0 / (cube["rate"] * cube["substeps"])))
    data, poses = mujoco.MjData(model), []
    for toss in tosses:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = np.split(from_world(toss[0]), [7])
        rows = np.empty((len(toss), 7))
        for row in rows:
            row[:] = data.qpos
            mujoco.mj_step(model, data, cube["substeps"])
        rows[:, ORIENTATION] = np.roll(rows[:, ORIENTATION], -1, axis=1)
        poses.append(rows)
    return poses


SIMULATIONS: Mapping[str, Callable[[Cube, Run, list[Array]], list[Array]]] = {"pybullet": _pybullet, "mujoco": _mujoco}

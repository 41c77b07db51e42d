"""Measured tosses as a source simulated them: their starts, their errors, their simulations in free flight, and wrong folders."""

import io
import zipfile

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.cli import dropspin

from dropspin.comparisons.published.sources import sources
from dropspin.comparisons.published.tosses import SIMULATIONS, errors, read_tosses

CUBE = {**sources(["acosta-cube"])[0].parameters["cube"], "tosses": 1}
RATE, HALF, G = CUBE["rate"], CUBE["half_side"], CUBE["gravity"]
VELOCITY, SPIN = np.array([1.5, -0.5, 1.0]), np.array([3.0, -4.0, 12.0])  # z up, in the world frame
START = Rotation.from_euler("xyz", [0.5, 1.0, -2.0])
FRAMES = 60


def flight(t):
    """Positions, velocities and orientations of a toss that spins about a fixed axis; it is low enough for a contact from frame 45 on."""
    position = np.array([0.1, 0.2, 0.25]) + np.outer(t, VELOCITY) - 0.5 * G * np.outer(t**2, [0.0, 0.0, 1.0])
    return position, VELOCITY - np.outer(G * t, [0.0, 0.0, 1.0]), Rotation.from_rotvec(np.outer(t, SPIN)) * START


def write(folder, rows):
    with zipfile.ZipFile(folder / "0.pt", "w") as archive:
        archive.writestr("archive/data.pkl", b"")
        archive.writestr("archive/data/1", rows.tobytes())


@pytest.fixture
def toss(tmp_path):
    """A file of a flight whose velocities are wrong in the file."""
    position, velocity, orientation = flight(np.arange(FRAMES) / RATE)
    rates = np.hstack([velocity / HALF, orientation.inv().apply(SPIN)])
    quaternion = np.roll(orientation.as_quat(), 1, axis=1)
    write(tmp_path, np.hstack([position / HALF, quaternion, 1.1 * rates, np.zeros((FRAMES, 6))]))
    [toss] = read_tosses(tmp_path, CUBE)
    return toss


def test_start_is_three_frames_before_a_contact_and_is_fitted_to_the_flight(toss):
    """Linear velocities are those of the frame before the start, vertical, and between both ends, horizontal: as in the source."""
    position, _, _ = flight(np.arange(FRAMES) / RATE)
    start = FRAMES - len(toss)
    assert start == int(np.argmax(position[:, 2] <= np.sqrt(3.0) * HALF)) - 3
    assert start > 10
    np.testing.assert_allclose(toss[:, :3], position[start:], rtol=1e-14)
    np.testing.assert_allclose(toss[0, 7:10], [*VELOCITY[:2], VELOCITY[2] - G * (start - 1) / RATE], rtol=1e-11)
    np.testing.assert_allclose(toss[0, 10:], SPIN * (1.0 - 2.0 * np.pi / (np.linalg.norm(SPIN) * start / RATE)), rtol=1e-11)


def test_planted_errors_are_measured_in_the_units_of_the_source(toss):
    poses = toss[:, :7].copy()
    poses[:, :3] += [0.003, 0.0, 0.004]
    poses[:, 3:] = (Rotation.from_rotvec([0.0, 0.1, 0.0]) * Rotation.from_quat(toss[:, 3:7])).as_quat()
    found = errors([poses, toss[:, :7]], [toss, toss], HALF)
    assert found == {
        "loss": pytest.approx(0.5 * (0.005**2 / HALF + 0.1**2), rel=1e-11),
        "position [% of the side]": pytest.approx(0.5 * 100.0 * 0.005 / (2.0 * HALF), rel=1e-12),
        "position, standard deviation": pytest.approx(0.5 * 100.0 * 0.005 / (2.0 * HALF), rel=1e-12),
        "rotation [°]": pytest.approx(0.5 * np.degrees(0.1), rel=1e-11),
        "rotation, standard deviation": pytest.approx(0.5 * np.degrees(0.1), rel=1e-11),
    }


@pytest.mark.parametrize(("engine", "damping"), [("mujoco", 0.0), ("pybullet", 0.04)])
def test_simulated_flight_is_the_exact_one_with_the_engines_damping(engine, damping):
    """Of fifteen frames: semi-implicit Euler is g t dt/2 = 0.32 mm too low; PyBullet decelerates by 0.04 v (1 + v), at most 1.1 mm.

    It decelerates the spin by k ω (1 + ω), so that ω/(1 + ω) = u decays as exp(-k t), and the angle is ln((1 - u)/(1 - u₀))/k.
    """
    t = np.arange(15) / RATE
    position, velocity, orientation = flight(t)
    toss = np.hstack([position, orientation.as_quat(), velocity, np.tile(SPIN, (15, 1))])
    [poses] = SIMULATIONS[engine](CUBE, {"stiffness": 1800.0, "damping": 27.0, "friction": 0.36}, [toss])
    np.testing.assert_allclose(poses[:, :3], position, atol=1.5e-3)
    spin = float(np.linalg.norm(SPIN))
    u = spin / (1.0 + spin) * np.exp(-damping * t)
    angle = np.log((1.0 - u) / (1.0 - u[0])) / damping if damping else spin * t
    turned = Rotation.from_rotvec(np.outer(angle, SPIN / spin)) * START
    assert (turned.inv() * Rotation.from_quat(poses[:, 3:])).magnitude().max() < 2e-3


def damaged(compression, encrypted):
    """A ZIP archive whose member is no deflated data, is encrypted, or has an unknown method of compression."""
    with zipfile.ZipFile(file := io.BytesIO(), "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("0/data/0", bytes(152))
    content = bytearray(file.getvalue())
    data, directory = content.index(b"0/data/0") + 8, content.index(b"PK\x01\x02")
    content[data : data + 4] = b"\xff" * 4
    content[6] = content[directory + 8] = encrypted
    content[8] = content[directory + 10] = compression
    return bytes(content)


def test_wrong_folders_are_refused_in_one_line(tmp_path):
    def refused(*arguments):
        done = dropspin("reproduce", *arguments, cwd=tmp_path)
        assert done.returncode == 2
        assert not (tmp_path / "out").exists()
        return done.stderr

    assert "acosta-cube: needs the folder examples/contact_parameter_learning" in refused("acosta-cube")
    assert "nowhere/0.pt: No such file or directory" in refused("acosta-cube", "nowhere")
    (tmp_path / "0.pt").write_bytes(b"\x80\x02")
    assert "0.pt: is not a toss: File is not a zip file; give the folder of the cleaned tosses." in refused("acosta-cube", ".")
    write(tmp_path, np.zeros(7))
    assert "0.pt: is not a toss: cannot reshape array" in refused("acosta-cube", ".")
    for compression, encrypted in ((8, 0), (8, 1), (97, 0)):
        (tmp_path / "0.pt").write_bytes(damaged(compression, encrypted))
        assert "0.pt: is not a toss: " in refused("acosta-cube", ".")
    assert "source 'nowhere' is unknown" in refused("nesc-brick", "nowhere")

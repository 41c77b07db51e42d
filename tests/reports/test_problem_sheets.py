"""The sheets of the numbered problems: they are what the code writes, and their text suffices to solve two of them with SciPy alone."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support.problem_sheets import END, INDEX, START, index_table, sheet, sheet_path

from dropspin.scenarios.problems import problems

VALUE = re.compile(r"(?<=\| )-?\d+\.\d{6,}(?= \|)")
"""A printed value of an exact solution, which is the only content of its cell."""
WRITE = "Write the sheets with PYTHONPATH=tests python -m support.problem_sheets; if an exact solution changed, say so in CHANGELOG.md."


@pytest.mark.parametrize("problem", problems().values(), ids=lambda problem: problem.number)
def test_sheet_is_what_the_code_writes(problem):
    """Its values within one unit of the last digit, which rounding may change between processors."""
    page, written = sheet_path(problem).read_text(encoding="utf-8"), sheet(problem)
    assert VALUE.sub("value", page) == VALUE.sub("value", written), WRITE
    for one, other in zip(VALUE.findall(page), VALUE.findall(written), strict=True):
        decimals = len(one.partition(".")[2])
        assert abs(float(one) - float(other)) < 1.5 * 10.0**-decimals, WRITE


def test_index_lists_every_sheet():
    assert INDEX.read_text(encoding="utf-8").partition(START)[2].partition(END)[0].strip() == index_table()
    assert sorted(INDEX.parent.glob("problems/*.md")) == [sheet_path(problem) for problem in problems().values()]


def cells(number, label):
    """The texts of a row of a sheet, without its label; of the first row that has it, which is the statement or a state."""
    text = sheet_path(problems()[number]).read_text(encoding="utf-8")
    return re.search(rf"^\| {re.escape(label)} \| (.*) \|$", text, re.MULTILINE)[1].split(" | ")


def given(number, label):
    """The numbers in a row of the statement."""
    return np.array([float(value) for value in re.findall(r"-?\d[\d.e-]*", cells(number, label)[0])])


def values(number, *labels):
    """The values in rows of the exact solution, one column for each label."""
    return np.array([[float(value) for value in cells(number, label)] for label in labels]).T


def body_flight(moments, q, w, until, height=None):
    """Euler's equations in the body frame and dq/dt = ½ q [ω_body, 0], until a time or until a height becomes 0."""

    def rates(_, y):
        (x, y_, z, s), w = y[:4], y[4:]
        a, b, c = w
        turn = 0.5 * np.array([s * a + y_ * c - z * b, s * b + z * a - x * c, s * c + x * b - y_ * a, -(x * a + y_ * b + z * c)])
        return np.concatenate([turn, np.cross(moments * w, w) / moments])

    if height is not None:
        height.terminal = True
    start = np.concatenate([q, Rotation.from_quat(q).inv().apply(w)])
    return solve_ivp(rates, (0.0, until), start, "DOP853", rtol=3e-14, atol=1e-15, dense_output=True, events=height)


def attitude(y):
    """The rotation of an integrated state, and its angular velocity in the world frame."""
    turn = Rotation.from_quat(y[:4])
    return turn, turn.apply(y[4:])


def assert_printed(found, printed, decimals):
    """Verify that values agree with printed ones within one unit of the last digit."""
    np.testing.assert_allclose(found, printed, rtol=0, atol=1.01 * 10.0**-decimals)


def test_tumbling_brick_is_solved_from_its_sheet():
    moments, q, w = (given("DS-008", label) for label in ("inertia", "q at t = 0", "ω at t = 0"))
    solved = body_flight(moments, q, w, 30.0)
    quaternions = values("DS-008", *(f"q_{axis}" for axis in "xyzw"))
    spins = values("DS-008", *(f"ω_{axis} [rad/s]" for axis in "xyz"))
    for t, quaternion, spin in zip([7.5, 15.0, 22.5, 30.0], quaternions, spins, strict=True):
        turn, found = attitude(solved.sol(t))
        assert_printed(turn.as_quat(canonical=True), quaternion, 10)
        assert_printed(found, spin, 10)


def test_box_that_sticks_with_a_corner_is_solved_from_its_sheet():
    """Flight, the impulse that the sheet describes, flight."""
    half, moments, x, q, v, w, g = (
        given("DS-024", label) for label in ("body", "inertia", *(f"{part} at t = 0" for part in "xqvω"), "gravity")
    )
    corners = half * [[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]

    def height(t, y):
        return (Rotation.from_quat(y[:4]).apply(corners) + x + v * t + 0.5 * g * t**2)[:, 1].min()

    fall = body_flight(moments, q, w, 0.6, height)
    [t] = fall.t_events[0]
    turn, w = attitude(fall.y_events[0][0])
    x, v = x + v * t + 0.5 * g * t**2, v + g * t
    arms = turn.apply(corners)
    r = arms[arms[:, 1].argmin()]
    inverse = turn.as_matrix() @ np.diag(1.0 / moments) @ turn.as_matrix().T
    u = v + np.cross(w, r)
    response = np.array([axis + np.cross(inverse @ np.cross(r, axis), r) for axis in np.eye(3)]).T  # of u to j, M = 1 kg
    j = np.linalg.solve(response, [-u[0], -1.5 * u[1], -u[2]])  # e = 0.5
    v, w = v + j, w + inverse @ np.cross(r, j)
    assert_printed([t], values("DS-024", "t [s]")[0], 10)
    assert_printed(v, values("DS-024", *(f"v_{axis} [m/s], after" for axis in "xyz"))[0], 9)
    assert_printed(w, values("DS-024", *(f"ω_{axis} [rad/s], after" for axis in "xyz"))[0], 9)
    turn, w = attitude(body_flight(moments, turn.as_quat(), w, 0.6 - t).y[:, -1])
    assert_printed(turn.as_quat(canonical=True), values("DS-024", *(f"q_{axis}" for axis in "xyzw"))[-1], 10)
    assert_printed(w, values("DS-024", *(f"ω_{axis} [rad/s]" for axis in "xyz"))[-1], 9)
    assert_printed(x + v * (0.6 - t) + 0.5 * g * (0.6 - t) ** 2, values("DS-024", *(f"x_{axis} [m]" for axis in "xyz"))[-1], 9)

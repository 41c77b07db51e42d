"""Runs: broken engines cost their own row, and planted faults are caught."""

import math
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from support import engines as made

import dropspin as ds

BALL = ds.load("drop-ball")


@pytest.mark.extended
@pytest.mark.parametrize(
    ("engine", "verdict", "reason", "code"),
    [
        (made.Crashing(), "crashed", "RuntimeError: no such thing as a floor", 3),
        (made.GivingUp(), "diverged", "step 3: a number beyond 1e10", 3),
        (made.Declining(), "declined", "I do not bounce", 0),
        (made.engine_with("nan", made.nan_after_half_a_second), "diverged", "the state is not finite at t = 0.50", 3),
        (made.HeavyInertia(), "crashed", "inertia is", 3),
        (made.WrongStart(), "crashed", "position at the start is", 3),
    ],
    ids=lambda case: getattr(case, "label", ""),
)
def test_broken_engine_costs_its_own_rows(engine, verdict, reason, code):
    """The row gives the reason, and the other engine is measured as usual."""
    found = ds.run(BALL, [engine, "pybullet"], 4e-3)
    [row] = found.table[found.table["engine"] == engine.label].to_dict("records")
    assert row["verdict"] == verdict
    assert row["reason"].startswith(reason)
    assert found.exit_code() == code
    assert found.table[found.table["engine"] == "pybullet"]["value"].notna().all()


# The fault, the scene that must detect it and one metric that must fail; each distortion acts on the exact motion.
FAULTS = {
    "restitution vanishes": (
        "drop-ball", "restitution_error",
        lambda s, t: np.concatenate([[0, 0.1, 0], s[3:7], np.zeros(6)]) if t > 0.452 else s,
    ),
    "swapped components of the quaternion": (
        "spin-asymmetric", "orientation_error", lambda s, t: s[[0, 1, 2, 4, 3, 5, 6, 7, 8, 9, 10, 11, 12]],
    ),
    "wxyz for xyzw": ("spin-asymmetric", "orientation_error", lambda s, t: s[[0, 1, 2, 6, 3, 4, 5, 7, 8, 9, 10, 11, 12]]),
    "attitude 2 degrees off": ("spin-asymmetric", "orientation_error", made.turned_by(math.radians(2))),
    "sideways push": ("drop-box-corner", "horizontal_momentum_error", lambda s, t: s + 1e-5 * np.eye(13)[7]),
    "1 % less spin": (
        "spin-dzhanibekov", "angular_momentum_error", lambda s, t: np.concatenate([s[:10], 0.99 * s[10:]]),
    ),
    "frozen attitude": ("spin-principal", "orientation_error", lambda s, t: np.concatenate([s[:3], [0, 0, 0, 1], s[7:]])),
    "sinks a centimetre": ("drop-box-flat", "penetration", lambda s, t: s - 0.01 * np.eye(13)[1]),
}  # fmt: skip


@pytest.mark.sample(1)
@pytest.mark.usefixtures("few_start_phases")
@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_caught(fault):
    """Each fault, planted in an exact engine, fails the metric that measures it."""
    scene, metric, distort = FAULTS[fault]
    engine = made.engine_with("planted", distort)
    found = ds.run(scene, engine, 1e-3)
    failed = found.table[found.table["verdict"] == "failed"]
    assert metric in set(failed["metric"]), found.table[["metric", "value", "verdict"]].to_string()
    assert found.exit_code() == 1


def test_one_per_cent_of_restitution_is_caught():
    """A ball with 1 % more restitution than the scene: 2 e² of that, 5e-3, in the apex."""
    found = ds.run([BALL], [made.TooLively()], [1e-3])
    failed = found.table[found.table["verdict"] == "failed"]
    assert {"bounce_height_error", "energy_error"} <= set(failed["metric"])


@pytest.mark.parametrize(("above", "verdict"), [(2e-3, "failed"), (0.0, "limited")])
def test_limitation_met_at_coarse_time_steps_alone_explains_no_model_error(above, verdict):
    """An engine shifted by 1 mm, with a limitation that explains 1 cm and that it meets at time steps larger than `above`."""

    class Shifted(made.Exact):
        name = "shifted"

        def prepare(self, scene, dt):
            simulation = made.ExactSimulation(scene, dt, lambda state, time: state + 1e-3 * np.eye(13)[0])
            simulation.known_limitations = [ds.KnownLimitation("coarse", {"position_error": 0.01})] if dt > above else []
            return simulation

    table = ds.run("fall-spin", Shifted(), [4e-3, 2e-3, 1e-3]).table
    [row] = table[(table["kind"] == "asymptotic_error") & (table["metric"] == "position_error")].to_dict("records")
    assert (row["cause"], row["verdict"]) == ("model", verdict)


@pytest.mark.parametrize("package", ["mujoco", "pybullet"])
def test_missing_engine_costs_its_row_and_fails_only_if_named(package, monkeypatch):
    """Its row says how to install it, and the rest runs."""
    for module in [name for name in sys.modules if name.startswith(f"dropspin.comparisons.engines.{package}")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, package, None)
    found = ds.run("drop-ball", ["wang", package], 4e-3)
    [row] = found.table[found.table["engine"] == package].to_dict("records")
    assert row["verdict"] == "missing"
    assert row["reason"].startswith(f"{package} is not installed: pip install {package}")
    assert (found.exit_code(), replace(found, provenance={**found.provenance, "named": [package]}).exit_code()) == (0, 3)
    assert (found.table["engine"] == "wang").sum() > 5


class Short(made.Exact):
    """Returns five rows, whatever is asked for."""

    name = "short"

    def prepare(self, scene, dt):
        simulation = made.ExactSimulation(scene, dt)
        simulation.record = lambda steps, every=1: made.ExactSimulation(scene, dt).record(4, 1)
        return simulation


class Narrow(made.Exact):
    """Returns twelve columns."""

    name = "narrow"

    def prepare(self, scene, dt):
        simulation = made.ExactSimulation(scene, dt)
        whole = simulation.record
        simulation.record = lambda steps, every=1: whole(steps, every)[:, :12]
        return simulation


@pytest.mark.parametrize(
    ("engine", "reason"),
    [
        (Short(), r"the record has shape \(5, 13\); 2501 states"),
        (Narrow(), r"the record has shape \(2501, 12\)"),
        (made.engine_with("zero-q", lambda s, t: np.concatenate([s[:3], np.zeros(4), s[7:]])), "has length 0; an orientation has length 1"),
        (made.engine_with("long-q", lambda s, t: np.concatenate([s[:3], 1.05 * s[3:7], s[7:]])), "has length 1.05"),
        (made.engine_with("complex", lambda s, t: s + 0j), "complex numbers"),
    ],
    ids=lambda case: getattr(case, "label", ""),
)
def test_malformed_record_is_refused(engine, reason):
    """Too few rows, too few columns, no orientation: the row gives the reason."""
    found = ds.run("spin-principal", engine, 4e-3)
    [row] = found.table.to_dict("records")
    assert row["verdict"] == "crashed"
    assert re.search(reason, row["reason"])
    assert "normalised" not in row["reason"]  # no length grows from step to step


@pytest.mark.extended
@pytest.mark.usefixtures("few_start_phases")
@pytest.mark.parametrize("dt", [4e-3, 2e-3, 1e-3])
@pytest.mark.parametrize("scene", ["drop-ball", "drop-ball-lively", "drop-box-flat", "drop-box-corner", "drop-box-sticking"])
def test_falling_through_the_floor_fails_at_every_step(scene, dt):
    """The missing contact fails restitution, and penetration or bounce height."""

    class NoFloor(made.Exact):
        name = "no-floor"

        def prepare(self, scene, dt):
            return made.ExactSimulation(scene.model_copy(update={"floor": None}), dt)

    found = ds.run(scene, NoFloor(), dt)
    failed = set(found.table[found.table["verdict"] == "failed"]["metric"])
    assert failed & {"penetration", "bounce_height_error"}
    assert "restitution_error" in failed
    assert found.exit_code() == 1


def test_engine_that_never_moves_fails_restitution():
    """Restitution is undefined without an impact; the other engine is not affected."""
    found = ds.run([BALL], [made.Frozen(), "pybullet"], [4e-3])
    [row] = found.table[(found.table["engine"] == "frozen") & (found.table["metric"] == "restitution_error")].to_dict("records")
    assert (row["verdict"], row["reason"]) == ("failed", "the event that it measures did not occur")
    assert found.table[found.table["engine"] == "pybullet"]["value"].notna().all()

"""What plots draw: numbers read back from the axes against closed forms."""

import io
from dataclasses import replace

import numpy as np
import pytest

import comparisons
import scenarios
from comparisons.results.store import restore, save
from reports import plots
from reports.plots.spins import VIEWS, energy_ellipsoid, facing
from reports.plots.style import power
from scenarios import DropspinError, Trajectory, load, truth_for
from scenarios.mechanics import kinetic_energy
from scenarios.rotations import about, multiply

DT = 1e-3


def made(scene, motion, dt=DT):
    """A run in which an engine did just this."""
    frame = comparisons.run([load("spin-principal")], ["mujoco"], [1e-2]).table.iloc[:0]
    return comparisons.Results(frame, {scene.name: scene}, ("made",), {(scene.name, "made", dt): motion})


def exactly(scene, dt=DT):
    """The truth at an engine's steps."""
    return truth_for(scene)(dt * np.arange(scene.steps(dt) + 1))


def axes_of(projection=None):
    from matplotlib.figure import Figure

    return Figure().add_subplot(projection=projection)


def line(axes, label):
    """The data of the line of a label."""
    [found] = [one for one in axes.get_lines() if one.get_label() == label]
    return found.get_data_3d() if hasattr(found, "get_data_3d") else found.get_data()


@pytest.mark.parametrize(("name", "e", "drop"), [("drop-ball", 0.5, 1.0), ("drop-ball-lively", None, None), ("bounce-95", 0.95, 1.0)])
def test_the_ladder_of_an_exact_motion_is_e_to_the_2k(name, e, drop):
    """Markers and stairs, for a dozen bounces and more: (v²/2g over the drop) to 1e-12, though each impact falls within a step."""
    scene = load(name)
    e = scene.floor.restitution if e is None else e
    axes = axes_of()
    plots.plot_bounce_ladder(made(scene, exactly(scene)), name, axes)
    (k, found), (stairs_k, stairs) = line(axes, "made"), line(axes, "truth")
    assert len(k) >= 5
    np.testing.assert_allclose(found, e ** (2.0 * np.asarray(k)), rtol=1e-11)
    np.testing.assert_allclose(stairs, e ** (2.0 * np.asarray(stairs_k)), rtol=1e-12)
    assert axes.get_yscale() == "log"


def test_a_velocity_that_lags_is_brought_to_its_position():
    """Leapfrog's states, half a step apart, rise as high as synchronised ones."""
    scene = load("drop-ball")
    exact = exactly(scene)
    lag = 0.5 * DT
    velocity = exact.velocity + lag * -scene.acceleration
    lagging = replace(exact, velocity=velocity, velocity_lag=lag)
    axes = axes_of()
    plots.plot_bounce_ladder(made(scene, lagging), scene.name, axes)
    k, found = line(axes, "made")
    # What is left is g lag²/2, of second order in the step.
    np.testing.assert_allclose(found, 0.25 ** np.asarray(k), atol=0.5 * 9.8 * lag**2 * 1.001)


def test_ladder_of_a_body_that_does_not_bounce():
    """One flight, the drop."""
    ball = load("drop-ball")
    dull = ball.model_copy(update={"floor": ball.floor.model_copy(update={"restitution": 0.0})})
    axes = axes_of()
    plots.plot_bounce_ladder(made(ball, exactly(dull)), ball.name, axes)
    assert line(axes, "made")[1] == pytest.approx([1.0], abs=1e-12)


@pytest.mark.parametrize("name", ["spin-asymmetric", "spin-dzhanibekov", "spin-needle"])
def test_the_truth_s_polhode_is_on_both_ellipsoids(name):
    """2T = Σ I ω² and L² = Σ I² ω² at every point to 1e-12, with the principal moments written out."""
    scene = load(name)
    axes = axes_of("3d")
    plots.plot_polhode(made(scene, exactly(scene, 1e-2), 1e-2), name, axes)
    moments, start = np.array(scene.body.inertia), np.array(scene.start.angular_velocity)
    for label in ("truth", "made"):
        spins = np.array(line(axes, label))
        assert spins.shape[1] > 100
        np.testing.assert_allclose(moments @ spins**2, moments @ start**2, rtol=1e-12)
        np.testing.assert_allclose(moments**2 @ spins**2, moments**2 @ start**2, rtol=1e-12)


def test_polhode_shows_a_missing_and_an_explicit_gyroscopic_term():
    """The note's method stays where it starts, Euler leaves the ellipsoid, the exact rotor stays on it."""
    scene, engines = load("spin-asymmetric"), ["document", "document[rotation=gyroscopic]", "document[rotation=exact]"]
    results = comparisons.run([scene], engines, [0.1])
    axes = axes_of("3d")
    plots.plot_polhode(results, scene.name, axes)
    still, euler, exact = (np.array(line(axes, engine)) for engine in engines)
    start, moments = np.array(scene.start.angular_velocity)[:, None], np.array(scene.body.inertia)
    np.testing.assert_allclose(still, np.broadcast_to(start, still.shape), atol=1e-13)
    growth = moments @ euler**2 / (moments @ start**2)
    assert growth[-1] > 1.1
    assert np.ptp(exact, axis=1).min() > 0.1
    np.testing.assert_allclose(moments @ exact**2, np.full(exact.shape[1], (moments @ start**2)[0]), rtol=1e-12)


def test_polhode_in_principal_axes():
    """A tensor that is not diagonal: the box as eight points, turned in its own frame, has the box's ellipsoid and path."""
    turn = about(np.array([0.6, 0.0, 0.8]), np.array(0.7))
    points = scenarios.rotations.rotate(turn, load("drop-box-tumble").body.vertices)
    turned = load(
        {"name": "turned", "duration": 5.0, "body": {"shape": "vertices", "points": points.tolist(), "mass": 1.0, "inertia": "vertices"}}
    )
    spinning = turned.model_copy(update={"start": turned.start.model_copy(update={"angular_velocity": (1.0, 2.0, 0.5)})})
    axes = axes_of("3d")
    plots.plot_polhode(made(spinning, exactly(spinning)), "turned", axes)
    spins = np.array(line(axes, "truth"))
    energies = (spins / energy_ellipsoid(spinning)[:, None]) ** 2
    np.testing.assert_allclose(energies.sum(axis=0), 1.0, rtol=1e-12)
    assert np.ptp(spins, axis=1).max() > 0.1


def test_the_curve_faces_the_reader():
    """A small circle about any half axis, either end, is on the near side."""
    half_axes, circle = np.array([1.5, 0.9, 0.8]), np.linspace(0.0, 2.0 * np.pi, 50)
    for axis in range(3):
        for end in (1.0, -1.0):
            path = np.zeros((50, 3))
            path[:, axis - 1], path[:, axis - 2], path[:, axis] = 0.1 * np.cos(circle), 0.1 * np.sin(circle), end * half_axes[axis]
            elevation, azimuth = np.radians(facing(path, half_axes))
            towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
            assert (path / half_axes**2 @ towards > 0.0).all()
    assert facing(np.tile([0.0, 0.0, 0.8], (2, 1)), half_axes) in [view for view in VIEWS if view[0] > 0]


def test_a_planted_error_grows_as_planted():
    """Attitude off by t² rad, place by t³ m, energy by a share of t: each line is that error at each of its times."""
    scene = load("fall-spin")
    exact = exactly(scene)
    off = np.sqrt(1.0 + 0.01 * exact.t)[:, None]
    linear = 0.5 * scene.body.mass * np.sum(exact.velocity**2, axis=1)
    planted = replace(
        exact,
        orientation=multiply(about(np.array([0.0, 0.6, 0.8]), 0.1 * exact.t**2), exact.orientation),
        position=exact.position + exact.t[:, None] ** 3 * np.array([0.0, 0.0, 1.0]),
    )
    axes = axes_of()
    plots.plot_error_growth(made(scene, planted), scene.name, "orientation_error", axes)
    t, found = line(axes, "made")
    assert len(t) > 300
    np.testing.assert_allclose(found, 0.1 * t**2, rtol=1e-6, atol=1e-14)
    axes = axes_of()
    plots.plot_error_growth(made(scene, planted), scene.name, "position_error", axes)
    t, found = line(axes, "made")
    np.testing.assert_allclose(found, t**3, rtol=1e-6, atol=1e-14)
    faster = replace(exact, velocity=exact.velocity * off)
    axes = axes_of()
    plots.plot_error_growth(made(scene, faster), scene.name, "energy_error", axes)
    t, found = line(axes, "made")
    share = np.interp(t, exact.t, 0.01 * exact.t * linear) / kinetic_energy(scene, exact).max()
    np.testing.assert_allclose(found, share, rtol=1e-9)


def test_impacts_make_no_spikes_and_lines_end_at_the_metric():
    """A ball whose impacts come 2 ms late: energy is compared between them only; the largest of a line is the metric's."""
    scene = load("drop-ball")
    t = DT * np.arange(scene.steps(DT) + 1)
    late = Trajectory.from_states(t, truth_for(scene)(np.maximum(t - 2e-3, 0.0)).states)
    axes = axes_of()
    plots.plot_error_growth(made(scene, late), scene.name, "energy_error", axes)
    found = line(axes, "made")[1]
    assert np.nanmax(found) < 1e-12  # a spike would be 1 - e² = 0.75
    assert np.isnan(found).sum() > 0.25 * len(found)
    results = comparisons.run([load("spin-asymmetric")], ["mujoco", "document"], [4e-2, 2e-2])
    for metric in ("energy_error", "orientation_error", "angular_momentum_error", "angular_momentum_direction_error"):
        axes = axes_of()
        plots.plot_error_growth(results, "spin-asymmetric", metric, axes)
        measured = results.measurements.set_index(["engine", "metric", "dt"])["value"]
        for engine in results.engines:
            largest = line(axes, engine)[1].max()
            assert largest == pytest.approx(abs(measured[engine, metric, 2e-2]), rel=1e-12, abs=1e-15)


def test_what_cannot_be_drawn_is_told():
    """One line each, with what to choose instead."""
    results = made(load("drop-ball"), exactly(load("drop-ball")))
    with pytest.raises(DropspinError, match=r"is unknown\. Did you mean 'energy_error'"):
        plots.plot_error_growth(results, "drop-ball", "energy_eror", axes_of())
    with pytest.raises(DropspinError, match="starts without spin"):
        plots.plot_polhode(results, "drop-ball", axes_of("3d"))
    spin = load("spin-principal")
    with pytest.raises(DropspinError, match="no bounces that are known"):
        plots.plot_bounce_ladder(made(spin, exactly(spin)), spin.name, axes_of())


@pytest.fixture(scope="module")
def ensemble():
    """Five starts of a box, a run."""
    scene = load("drop-box-anyhow")
    few = scene.model_copy(update={"ensemble": scene.ensemble.model_copy(update={"size": 5}), "expect": (), "duration": 0.6})
    return comparisons.run([few], ["document", "mujoco"], [4e-3])


def test_angular_momentum_of_an_ensemble(ensemble):
    """At the start |L| = |I ω| of each member over r √(2 E M), written out; the median is drawn."""
    [scene] = ensemble.scenes.values()
    outcome = ensemble.ensembles[scene.name, "mujoco", 4e-3]
    expected = []
    for member in scenarios.members(scene):
        spin = scenarios.rotations.unrotate(np.array(member.start.orientation), np.array(member.start.angular_velocity))
        momentum = np.linalg.norm(np.diag(scene.body.inertia_tensor) * spin)
        energy = max(9.8 * member.clearance, 0.5 * spin @ (np.diag(scene.body.inertia_tensor) * spin))
        expected.append(momentum / (np.sqrt(0.1**2 + 0.15**2 + 0.25**2) * np.sqrt(2.0 * energy)))
    np.testing.assert_allclose(outcome.angular_momentum[:, 0], expected, rtol=1e-12)
    axes = axes_of()
    plots.plot_angular_momentum_of_ensemble(ensemble, scene.name, axes)
    np.testing.assert_array_equal(line(axes, "mujoco")[1], np.median(outcome.angular_momentum, axis=0))


def test_runs_from_before_angular_momenta_were_kept(ensemble, tmp_path):
    """They come back, are saved and drawn without it; asked for it, one line says what to do."""
    [name] = ensemble.scenes
    older = replace(ensemble, ensembles={key: replace(outcome, angular_momentum=None) for key, outcome in ensemble.ensembles.items()})
    save(older, tmp_path)
    again = restore(tmp_path)
    for key, outcome in again.ensembles.items():
        assert outcome.angular_momentum is None
        np.testing.assert_array_equal(outcome.energy, ensemble.ensembles[key].energy)
    assert len(plots.ensemble_figure(again, name).axes) == 2
    assert len(plots.ensemble_figure(ensemble, name).axes) == 3
    with pytest.raises(DropspinError, match="run it again"):
        plots.plot_angular_momentum_of_ensemble(again, name, axes_of())


def test_plain_text_powers():
    """As a reader writes them."""
    assert [power(value) for value in (1.0, 1e-3, 2e-3, 5e12, 2.5e-11)] == ["10⁰", "10⁻³", "2×10⁻³", "5×10¹²", "2.5×10⁻¹¹"]


@pytest.mark.parametrize("nonsense", [np.nan, np.inf, 1e300])
def test_an_engine_that_talks_nonsense_is_drawn_as_far_as_it_makes_sense(nonsense):
    """From the tenth of a second on every number is nonsense: no warning, and what came before is drawn."""
    for name, plot, projection in [
        ("drop-ball", plots.plot_bounce_ladder, None),
        ("spin-asymmetric", plots.plot_polhode, "3d"),
        ("fall-spin", lambda results, name, axes: plots.plot_error_growth(results, name, "energy_error", axes), None),
    ]:
        scene = load(name)
        states = exactly(scene).states.copy()
        states[100:, 7:] = nonsense
        motion = Trajectory.from_states(DT * np.arange(len(states)), states)
        axes = axes_of(projection)
        plot(made(scene, motion), name, axes)
        axes.figure.savefig(io.BytesIO())
        if name != "drop-ball":
            assert len(line(axes, "made")[0]) >= 2

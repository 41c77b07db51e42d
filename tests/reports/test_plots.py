"""Plots: the data read back from the axes are compared with closed forms."""

import io
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import dropspin as ds
from dropspin.comparisons.results.store import save
from dropspin.comparisons.results.table import as_table
from dropspin.reports import plots
from dropspin.reports.plots.colours import engine_styles
from dropspin.reports.plots.polhodes import energy_ellipsoid, polhode_paths
from dropspin.reports.plots.run_charts import ensemble_charts
from dropspin.reports.plots.style import plain, power
from dropspin.scenarios import Trajectory, members, truth_for
from dropspin.scenarios.mechanics import energy, kinetic_energy
from dropspin.scenarios.rotations import about, multiply, rotate, unrotate
from dropspin.scenarios.truths.truth import EXACT

DT = 1e-3


def made(scene, motion, dt=DT):
    """A run in which the engine `made` has this motion."""
    return ds.Results(as_table([]), {scene.name: scene}, ("made",), {(scene.name, "made", dt): motion})


def exactly(scene, dt=DT):
    """The exact solution at the time steps."""
    return truth_for(scene)(dt * np.arange(scene.steps(dt) + 1))


def axes_of():
    from matplotlib.figure import Figure

    return Figure().add_subplot()


def line(axes, label):
    """The data of the line with a label."""
    return next(one.get_data() for one in axes.get_lines() if one.get_label() == plots.human_label(label))


def spins_of(results, name):
    """The paths of a polhode, shape (3, n), by label."""
    return {style["label"]: path.T for path, style in polhode_paths(results, name)}


@pytest.mark.parametrize(("name", "e", "drop"), [("drop-ball", 0.5, 1.0), ("drop-ball-lively", None, None), ("bounce-95", 0.95, 1.0)])
def test_bounce_ladder_of_the_exact_motion_is_e_to_the_2k(name, e, drop):
    """Markers and stairs, for five bounces or more: v²/2g over the drop height, to rounding, although impacts fall within time steps."""
    scene = ds.load(name)
    e = scene.floor.restitution if e is None else e
    axes = axes_of()
    plots.plot_bounce_ladder(made(scene, exactly(scene)), name, axes)
    (k, found), (stairs_k, stairs) = line(axes, "made"), line(axes, EXACT)
    assert len(k) >= 5
    np.testing.assert_allclose(found, e ** (2.0 * np.asarray(k)), rtol=1e-11)
    np.testing.assert_allclose(stairs, e ** (2.0 * np.asarray(stairs_k)), rtol=1e-12)
    assert axes.get_yscale() == "log"


def test_bounce_ladder_synchronises_a_lagging_velocity():
    """Leapfrog states, whose velocity lags by half a step, have the apexes of synchronised ones."""
    scene = ds.load("drop-ball")
    exact = exactly(scene)
    lag = 0.5 * DT
    velocity = exact.velocity + lag * -scene.acceleration
    lagging = replace(exact, velocity=velocity, velocity_lag=lag)
    axes = axes_of()
    plots.plot_bounce_ladder(made(scene, lagging), scene.name, axes)
    k, found = line(axes, "made")
    # The remaining difference is g lag²/2, of second order in the time step.
    np.testing.assert_allclose(found, 0.25 ** np.asarray(k), atol=0.5 * 9.8 * lag**2 * 1.001)


def test_bounce_ladder_without_a_bounce_has_the_drop_only():
    ball = ds.load("drop-ball")
    dull = ball.model_copy(update={"floor": ball.floor.model_copy(update={"restitution": 0.0})})
    axes = axes_of()
    plots.plot_bounce_ladder(made(ball, exactly(dull)), ball.name, axes)
    assert line(axes, "made")[1] == pytest.approx([1.0], abs=1e-12)


@pytest.mark.parametrize("name", ["spin-asymmetric", "spin-dzhanibekov", "spin-needle"])
def test_exact_polhode_lies_on_both_ellipsoids(name):
    """2T = Σ I ω² and L² = Σ I² ω² at every point to 1e-12, with the principal moments of the scene."""
    scene = ds.load(name)
    found = spins_of(made(scene, exactly(scene, 1e-2), 1e-2), name)
    moments, start = np.array(scene.body.inertia), np.array(scene.start.angular_velocity)
    for label in (EXACT, "made"):
        spins = found[label]
        assert spins.shape[1] > 100
        np.testing.assert_allclose(moments @ spins**2, moments @ start**2, rtol=1e-12)
        np.testing.assert_allclose(moments**2 @ spins**2, moments**2 @ start**2, rtol=1e-12)


def test_polhode_shows_a_missing_and_an_explicit_gyroscopic_term():
    """The path of Wang's method is a point, explicit Euler leaves the ellipsoid, the exact rotor stays on it."""
    scene, engines = ds.load("spin-asymmetric"), ["wang", "wang[rotation=gyroscopic]", "wang[rotation=exact]"]
    results = ds.run(scene, engines, dt=0.1)
    found = spins_of(results, scene.name)
    still, euler, exact = (found[engine] for engine in engines)
    start, moments = np.array(scene.start.angular_velocity)[:, None], np.array(scene.body.inertia)
    np.testing.assert_allclose(still, np.broadcast_to(start, still.shape), atol=1e-13)
    growth = moments @ euler**2 / (moments @ start**2)
    assert growth[-1] > 1.1
    assert np.ptp(exact, axis=1).min() > 0.1
    np.testing.assert_allclose(moments @ exact**2, np.full(exact.shape[1], (moments @ start**2)[0]), rtol=1e-12)


def test_polhode_in_principal_axes():
    """An inertia tensor that is not diagonal: a box as eight points, rotated in its body frame, has the same ellipsoid and path."""
    turn = about(np.array([0.6, 0.0, 0.8]), np.array(0.7))
    points = rotate(turn, ds.load("drop-box-tumble").body.vertices)
    turned = ds.load(
        {"name": "turned", "duration": 5.0, "body": {"shape": "vertices", "points": points.tolist(), "mass": 1.0, "inertia": "vertices"}}
    )
    spinning = turned.model_copy(update={"start": turned.start.model_copy(update={"angular_velocity": (1.0, 2.0, 0.5)})})
    spins = spins_of(made(spinning, exactly(spinning)), "turned")[EXACT]
    energies = (spins / energy_ellipsoid(spinning)[:, None]) ** 2
    np.testing.assert_allclose(energies.sum(axis=0), 1.0, rtol=1e-12)
    assert np.ptp(spins, axis=1).max() > 0.1


def test_error_over_time_shows_a_planted_error():
    """Attitude off by t² rad, position by t³ m, energy by a fraction of t: each line is that error at each of its times."""
    scene = ds.load("fall-spin")
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


def test_error_over_time_has_gaps_at_impacts_and_the_metric_as_maximum():
    """A ball whose impacts come 2 ms late: energy is compared between impacts only; the maximum of a line is the value of the metric."""
    scene = ds.load("drop-ball")
    t = DT * np.arange(scene.steps(DT) + 1)
    late = Trajectory.from_states(t, truth_for(scene)(np.maximum(t - 2e-3, 0.0)).states)
    axes = axes_of()
    plots.plot_error_growth(made(scene, late), scene.name, "energy_error", axes)
    found = line(axes, "made")[1]
    assert np.nanmax(found) < 1e-12  # a spike would be 1 - e² = 0.75
    assert np.isnan(found).sum() > 0.25 * len(found)
    results = ds.run("spin-asymmetric", ["mujoco", "wang"], dt=[4e-2, 2e-2])
    for metric in ("energy_error", "orientation_error", "angular_momentum_error", "angular_momentum_direction_error"):
        axes = axes_of()
        plots.plot_error_growth(results, "spin-asymmetric", metric, axes)
        measured = results.measurements.set_index(["engine", "metric", "dt"])["value"]
        for engine in results.engines:
            largest = line(axes, engine)[1].max()
            assert largest == pytest.approx(abs(measured[engine, metric, 2e-2]), rel=1e-12, abs=1e-15)


def test_plots_name_a_valid_choice_when_they_cannot_draw():
    results = made(ds.load("drop-ball"), exactly(ds.load("drop-ball")))
    with pytest.raises(ds.DropspinError, match=r"is unknown\. Did you mean 'energy_error'"):
        plots.plot_error_growth(results, "drop-ball", "energy_eror", axes_of())
    with pytest.raises(
        ds.DropspinError, match=r"drop-ball has no initial angular velocity, so it has no polhode; set start\.angular_velocity\."
    ):
        plots.plot_polhode(results, "drop-ball", axes_of())
    spin = ds.load("spin-principal")
    with pytest.raises(
        ds.DropspinError, match=r"spin-principal: the exact solution has no bounces; choose a scene that has some, such as drop-ball\."
    ):
        plots.plot_bounce_ladder(made(spin, exactly(spin)), spin.name, axes_of())


@pytest.fixture(scope="module")
def ensemble():
    """A run with an ensemble of five starts."""
    scene = ds.load("drop-box-anyhow")
    few = scene.model_copy(update={"ensemble": scene.ensemble.model_copy(update={"size": 5}), "expect": (), "duration": 0.6})
    return ds.run(few, ["wang", "mujoco"], dt=4e-3)


def test_angular_momentum_of_an_ensemble(ensemble):
    """At the start |L| = |I ω| of each member, divided by r √(2 E M); the median is drawn."""
    [scene] = ensemble.scenes.values()
    outcome = ensemble.ensembles[scene.name, "mujoco", 4e-3]
    expected = []
    for member in members(scene):
        spin = unrotate(np.array(member.start.orientation), np.array(member.start.angular_velocity))
        momentum = np.linalg.norm(np.diag(scene.body.inertia_tensor) * spin)
        energy = max(9.8 * member.clearance, 0.5 * spin @ (np.diag(scene.body.inertia_tensor) * spin))
        expected.append(momentum / (np.sqrt(0.1**2 + 0.15**2 + 0.25**2) * np.sqrt(2.0 * energy)))
    np.testing.assert_allclose(outcome.angular_momentum[:, 0], expected, rtol=1e-12)
    axes = axes_of()
    plots.plot_angular_momentum_of_ensemble(ensemble, scene.name, axes)
    np.testing.assert_array_equal(line(axes, "mujoco")[1], np.median(outcome.angular_momentum, axis=0))


def test_a_member_in_motion_at_the_end_is_not_at_rest(ensemble):
    """The fraction at rest ends at that of the members that rested before."""
    [name] = ensemble.scenes
    outcome = ensemble.ensembles[name, "mujoco", 4e-3]
    still_moving = outcome.rest_time == outcome.t[-1]
    assert still_moving.any()  # after .6 s
    drawn = next(one for one in plots.rest_of_ensemble(ensemble, name).lines if one.label == "mujoco")
    assert drawn.y[-1] == 1.0 - still_moving.mean()


def test_a_spin_too_fast_to_draw_is_an_envelope():
    """500 rad/s for 10 s: the band of the upward component is as wide as its range, and no curve of a period of 4.5 s is drawn."""
    scene = ds.load("spin-principal-500")
    found = {one.label: one for one in plots.over_time(made(scene, exactly(scene, 4e-3), 4e-3), scene.name, plots.tilt).lines}
    assert all(one.is_fill for one in found.values())
    exact = found[EXACT]
    axis = np.array(scene.start.angular_velocity) / np.linalg.norm(scene.start.angular_velocity)
    up = rotate(np.array(scene.start.orientation), np.array([0.0, 1.0, 0.0]))
    across = np.linalg.norm(up - (up @ axis) * axis) * np.linalg.norm([0.0, 1.0, 0.0] - axis[1] * axis)
    np.testing.assert_allclose(exact.high[:-1], (up @ axis) * axis[1] + across, atol=0.02 * across)
    np.testing.assert_allclose(exact.low[:-1], (up @ axis) * axis[1] - across, atol=0.02 * across)


def test_small_late_bounces_too_fast_to_draw_are_an_envelope():
    """3 % of the range, for 40 s of 60 s: points 0.15 s apart would show bounces of 0.156 s as ones of 6 s."""
    scene = ds.load("bounce-95")
    exact = exactly(scene)
    position, late = exact.position.copy(), exact.t > 20.0
    position[late, 1] = 0.1 + 0.03 * np.abs(np.sin(np.pi * exact.t[late] / 0.156))
    chart = plots.over_time(made(scene, replace(exact, position=position)), scene.name, plots.height)
    assert [one.is_fill for one in chart.lines] == [True, True]
    assert np.ptp(chart.lines[0].high[200:-1]) < 1e-3


def test_rounding_around_0_is_no_oscillation():
    """The energy of a box that stays on a slope, in an engine."""
    scene = ds.load("slope-box-hold")
    exact = exactly(scene)
    noisy = replace(exact, velocity=exact.velocity + 1e-9 * np.random.default_rng(1).normal(size=exact.velocity.shape))
    assert not any(one.is_fill for one in plots.over_time(made(scene, noisy), scene.name, energy).lines)


def test_rounding_errors_of_a_constant_are_not_magnified():
    """The energy of a free spin is constant: the axis reaches a tenth of its value up and down."""
    scene = ds.load("spin-principal")
    chart = plots.over_time(made(scene, exactly(scene)), scene.name, energy)
    assert chart.is_flat
    axes = axes_of()
    plots.draw(chart, axes)
    low, high = axes.get_ylim()
    assert high - low == pytest.approx(0.2 * chart.lines[0].y[0], rel=1e-6)


def test_impacts_are_drawn_as_lines_and_not_as_envelopes():
    scene = ds.load("drop-ball")
    chart = plots.over_time(made(scene, exactly(scene)), scene.name, energy)
    assert not any(one.is_fill for one in chart.lines)


@pytest.mark.parametrize("count", [3, 9, 20, 40])
def test_engines_have_colours_and_markers_of_their_own(count):
    """Up to 40 engines differ in colour and marker, up to 9 in the colour besides the built-in ones; more have dash patterns."""
    labels = [f"wang[rotation={number}]" for number in range(count - 1)]
    styles = engine_styles(["mujoco", *labels])
    assert len({style[:2] for style in styles.values()}) == count
    assert len({style.colour for style in styles.values()}) == min(count, 10)
    assert any(style.dashes for style in styles.values()) == (count > 10)
    assert engine_styles(["mujoco"])["mujoco"] == engine_styles(["pybullet", "mujoco"])["mujoco"] == styles["mujoco"]
    assert engine_styles([labels[0]])[labels[0]] == engine_styles(["mujoco", labels[0]])[labels[0]]


@pytest.mark.parametrize(
    ("label", "name"),
    [
        ("mujoco[integrator=rk4]", "MuJoCo, RK4"),
        ("wang[rotation=gyroscopic]", "Wang's method, rotation gyroscopic"),
        ("mujoco[profile=default,solref=-1000 0]", "MuJoCo, default settings, solref −1000 0"),
        ("my_module:MyEngine[precision=float32]", "MyEngine, precision float32"),
        ("my-engine", "my-engine"),
        ("exact solution", "exact solution"),
        ("mujoco[integrator=rk4], mirrored", "MuJoCo, RK4, mirrored"),
    ],
)
def test_labels_name_engines_as_their_authors_do(label, name):
    assert plots.human_label(label) == name


@pytest.fixture
def lines_of():
    """Charts with a horizontal line at each of some heights, which end at 1 but for the first."""

    def chart(*heights, end=1.0):
        ends = [end, *[1.0] * (len(heights) - 1)]
        return plots.Chart(
            "x", "y", [plots.Line(f"at {y}", np.array([0.0, x]), np.full(2, y), "#0072B2") for y, x in zip(heights, ends, strict=True)]
        )

    return chart


def test_single_chart_has_labels_at_the_ends_of_lines_where_they_fit(lines_of):
    """Each at the height of its line, or moved by less than two lines of text where lines are close; else there is a legend."""
    figure = plots.figure_of([lines_of(0.0, 0.5, 1.0)], "column")
    [axes] = figure.axes
    figure.draw_without_rendering()
    places = {text.get_text(): text.get_window_extent() for text in axes.texts}
    for y in (0.0, 0.5, 1.0):
        box = places[f"at {y}"]
        assert 0.5 * (box.y0 + box.y1) == pytest.approx(axes.transData.transform((1.0, y))[1], abs=4.0)
        assert box.x0 > axes.bbox.x1
        assert box.x1 < figure.bbox.x1
    near = plots.figure_of([lines_of(0.0, 0.01, 1.0)], "column").axes[0]
    low, high, _ = (text.get_window_extent() for text in near.texts)
    assert low.y1 <= high.y0 + 1.0
    long = plots.Chart("x", "y", [plots.Line("a label of more than a quarter of a column", np.arange(2.0), np.zeros(2))])
    for crowded in (lines_of(0.0, 0.001, 0.002, 0.003, 0.004, 1.0), lines_of(0.0, 1.0, end=0.5), long):
        figure = plots.figure_of([crowded], "column")
        assert not figure.axes[0].texts
        assert len(figure.legends) == 1


@pytest.mark.extended
@pytest.mark.parametrize(("size", "inches"), [("column", 3.4), ("page", 7.0)])
def test_legend_is_within_the_figure(lines_of, size, inches):
    """Also if labels are long; one panel of rows, as of a study of limits, and several."""
    long = [
        plots.Line(f"a label of an engine with several options, {number}", np.arange(2.0), np.full(2, 0.0), "#0072B2", 9.0)
        for number in range(6)
    ]
    for charts in ([plots.Chart("x", "", long, rows=["a"])], [lines_of(0.0, 1.0), plots.Chart("x", "y", long)]):
        figure = plots.figure_of(charts, size)
        assert figure.get_size_inches()[0] == inches
        figure.draw_without_rendering()
        box = figure.legends[0].get_window_extent()
        assert box.x0 >= 0.0
        assert box.y1 <= figure.bbox.y1 + 1.0
        assert box.x1 <= figure.bbox.x1 or size == "column"
        assert box.y0 >= max(axes.bbox.y1 for axes in figure.axes)


def test_grey_figures_have_no_colour_and_dark_ones_white_text(lines_of):
    chart = lines_of(*np.linspace(0.0, 1.0, 6))
    for look in ("grey", "dark"):
        figure = plots.figure_of([chart], "column", look)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="rgba", facecolor=figure.get_facecolor())
        pixels = np.frombuffer(buffer.getvalue(), np.uint8).reshape(-1, 4)[:, :3]
        assert (np.ptp(pixels, axis=1).max() == 0) == (look == "grey")
        assert np.median(pixels) == (255 if look == "grey" else 0)
        if look == "grey":
            assert len({(line.get_color(), line.get_linestyle()) for line in figure.axes[0].get_lines()}) == 6
    with pytest.raises(ds.DropspinError, match="Did you mean 'grey'"), plots.style("column", "gray"):
        pass


def test_pdf_has_truetype_fonts_and_no_time(lines_of, tmp_path):
    for name in ("a.pdf", "b.pdf"):
        plots.save_figure(plots.figure_of([lines_of(-1.0, 1.0)]), tmp_path / name)
    content = (tmp_path / "a.pdf").read_bytes()
    assert content == (tmp_path / "b.pdf").read_bytes()
    assert b"/CIDFontType2" in content  # TrueType
    assert b"/Type3" not in content


def test_data_of_charts_is_saved_with_all_digits(lines_of, tmp_path):
    band = plots.Line("band", np.array([0.0, 0.1]), np.zeros(2), low=np.array([-1.0, -2.0]), high=np.array([1.0, 1 / 3]), is_fill=True)
    plots.save_data([lines_of(1 / 3), plots.Chart("x", "y", [band])], tmp_path / "data.csv")
    rows = (tmp_path / "data.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0] == "chart,x_label,y_label,line,drawn,x,y,low,high"
    assert rows[1] == f"1,x,y,at {1 / 3},line,0.0,{1 / 3},,"
    assert rows[4] == f"2,x,y,band,band,0.1,,-2.0,{1 / 3}"


def test_data_of_errors_over_the_time_step_are_in_seconds_with_points_apart_from_fits(tmp_path):
    """The ticks of the chart are in milliseconds."""
    results = ds.run("spin-dzhanibekov", "mujoco", dt=[8e-3, 4e-3, 2e-3])
    plots.save_data([plots.error_over_dt(results, "spin-dzhanibekov", "orientation_error")], tmp_path / "data.csv")
    data = pd.read_csv(tmp_path / "data.csv").query("line == 'mujoco' and drawn == 'points'")
    assert [*data["x_label"].unique(), *data["y_label"].unique()] == ["time step [s]", "absolute value of orientation error [rad]"]
    errors = results.measurements.query("metric == 'orientation_error'")
    np.testing.assert_array_equal(data[["x", "y"]], errors.assign(value=errors["value"].abs()).sort_values("dt")[["dt", "value"]])


def test_ensembles_are_saved_and_drawn_in_three_panels(ensemble, tmp_path):
    [name] = ensemble.scenes
    save(ensemble, tmp_path)
    loaded = ds.load_results(tmp_path)
    assert loaded.ensembles.keys() == ensemble.ensembles.keys()
    for key, outcome in loaded.ensembles.items():
        for part in vars(outcome):
            np.testing.assert_array_equal(getattr(outcome, part), getattr(ensemble.ensembles[key], part))
    assert len(plots.figure_of(ensemble_charts(loaded, name)).axes) == 3


def test_numbers_are_plain_text_with_minus_signs():
    assert [plain(value) for value in (0.0, 0.25, -1.0, 6.358e-4, 1e4)] == ["0", "0.25", "−1", "6.358×10⁻⁴", "10⁴"]
    assert [power(value) for value in (1.0, 1e-3, 2e-3, 5e12, 2.5e-11)] == ["10⁰", "10⁻³", "2×10⁻³", "5×10¹²", "2.5×10⁻¹¹"]


@pytest.mark.parametrize("invalid", [np.nan, np.inf, 1e300])
def test_plots_draw_a_motion_up_to_its_first_invalid_state(invalid):
    """Velocities are invalid from 0.1 s on: no warning, and the part before is drawn."""
    for name, plot in [
        ("drop-ball", plots.plot_bounce_ladder),
        ("spin-asymmetric", plots.plot_polhode),
        ("fall-spin", lambda results, name, axes: plots.plot_error_growth(results, name, "energy_error", axes)),
    ]:
        scene = ds.load(name)
        states = exactly(scene).states.copy()
        states[100:, 7:] = invalid
        motion = Trajectory.from_states(DT * np.arange(len(states)), states)
        axes = axes_of()
        plot(made(scene, motion), name, axes)
        axes.figure.savefig(io.BytesIO())
        if name != "drop-ball":
            assert len(line(axes, "made")[0]) >= 2

"""Jobs follow from their numbers alone, keys identify jobs, and a spec that is not valid is refused in one line."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropspin.comparisons.sweeps.axes import Drawn, Spaced
from dropspin.comparisons.sweeps.spec import load_sweep
from dropspin.scenarios import DropspinError, load
from dropspin.scenarios.ensemble import spread_start, spread_starts, uniform
from dropspin.scenarios.state import ORIENTATION, RATES

SPEC = {
    "scenes": ["drop-box-anyhow", "drop-ball"],
    "engines": ["wang", "wang[law=poisson]"],
    "dts": [4e-3, 2e-3, 1e-3],
    "grid": {"floor.restitution": [0.1, 0.5], "body": {"mass": {"from": 1.0, "to": 4.0, "count": 3, "spacing": "log"}}},
    "random": {"count": 5, "seed": 3, "start.position[1]": {"from": 0.6, "to": 2.0}},
}
SWEEP = load_sweep(SPEC)


def rows(sweep, first, last):
    """The jobs as tuples: scene, engine, time step, start, values."""
    return [
        (jobs.scene.name, jobs.engine.label, dt, seed, *values)
        for jobs in sweep.jobs(first, last)
        for dt, seed, *values in zip(jobs.dts, jobs.starts(), *jobs.values.values(), strict=True)
    ]


def hashes(sweep, first, last):
    return [key for jobs in sweep.jobs(first, last) for key in jobs.hashes()]


def test_jobs_are_the_product_in_the_order_of_nested_loops():
    """The draws are innermost; a log axis includes its ends and the geometric mean."""
    heights = 0.6 + 1.4 * uniform(3, "start.position[1]", np.arange(5))
    nested = itertools.product(SPEC["scenes"], SPEC["engines"], SPEC["dts"], [None], [0.1, 0.5], [1.0, 2.0, 4.0], heights)
    assert rows(SWEEP, 0, SWEEP.size) == list(nested)


@given(st.data())
def test_jobs_do_not_depend_on_the_range_that_is_requested(data):
    """Neither their values nor their keys."""
    first = data.draw(st.integers(0, SWEEP.size - 1))
    last = data.draw(st.integers(first + 1, SWEEP.size))
    assert rows(SWEEP, first, last) == rows(SWEEP, 0, SWEEP.size)[first:last]
    assert hashes(SWEEP, first, last) == hashes(SWEEP, 0, SWEEP.size)[first:last]


def test_last_jobs_of_a_huge_sweep_are_computed_at_once():
    """The last thousand of 10¹² jobs; draws with large indices are uniform in their range."""
    vast = load_sweep(SPEC | {"random": SPEC["random"] | {"count": 10**11}})
    assert vast.size > 10**12
    [jobs] = vast.jobs(vast.size - 1000, vast.size)
    assert jobs.numbers[-1] == vast.size - 1
    heights = jobs.values["start.position[1]"]
    assert (heights.min() >= 0.6) & (heights.max() < 2.0)
    assert heights.mean() == pytest.approx(1.3, abs=0.05)


@given(st.integers(0, 2**62), st.lists(st.integers(0, 10**12), min_size=1, max_size=50))
def test_draws_depend_only_on_their_index(seed, numbers):
    """Any draws, in any order and with any others, are those drawn one by one."""
    together = uniform(seed, "x", np.array(numbers))
    assert list(together) == [uniform(seed, "x", np.array([number]))[0] for number in numbers]
    assert ((together >= 0.0) & (together < 1.0)).all()


def test_draws_of_different_axes_and_seeds_are_uncorrelated():
    """Correlations of 20,000 pairs are within 4/√n, those of neighbours included."""
    n = np.arange(20_000)
    a, b, c = uniform(1, "a", n), uniform(1, "b", n), uniform(2, "a", n)
    for pair in ((a, b), (a, c), (a[1:], a[:-1])):
        assert abs(np.corrcoef(*pair)[0, 1]) < 4 / np.sqrt(len(n))


def test_a_sweep_with_more_draws_begins_with_those_of_fewer():
    more = load_sweep(SPEC | {"random": SPEC["random"] | {"count": 5000}})
    assert rows(more, 0, 5) == rows(SWEEP, 0, 5)
    assert hashes(more, 0, 5) == hashes(SWEEP, 0, 5)


def test_keys_are_unique_and_the_same_in_any_sweep():
    """A job has the same key in another sweep, with another number, and with a value written as 2 or 2.0."""
    assert len(set(hashes(SWEEP, 0, SWEEP.size))) == SWEEP.size
    fewer = load_sweep(SPEC | {"scenes": ["drop-ball"], "engines": ["wang[law=poisson]"], "dts": [1e-3]})
    assert hashes(fewer, 0, fewer.size) == hashes(SWEEP, SWEEP.size - fewer.size, SWEEP.size)
    plain = {"scenes": ["drop-ball"], "engines": ["wang"], "dts": [1e-3]}
    one, same, other = (load_sweep(plain | {"grid": {"body.mass": masses}}) for masses in ([2], [2.0], [3.0]))
    assert hashes(one, 0, 1) == hashes(same, 0, 1) != hashes(other, 0, 1)


def test_key_is_the_same_for_an_option_in_the_name_or_on_an_axis():
    plain = {"scenes": ["drop-ball"], "dts": [1e-3]}
    named = load_sweep(plain | {"engines": ["mujoco[spring_steps=20]"]})
    swept = load_sweep(plain | {"engines": ["mujoco"], "grid": {"engine.spring_steps": [20]}})
    assert hashes(named, 0, 1) == hashes(swept, 0, 1)
    assert swept.jobs(0, 1)[0].labels() == ["mujoco[spring_steps=20]"]


def test_key_does_not_change_between_versions():
    """Users join tables by it; a change of this value must be in the changelog."""
    assert hashes(SWEEP, 0, 1) == ["2c95f68bcc102f9ba48f"]


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.integers(2, 50), st.sampled_from(["linear", "log"]))
def test_spaced_values_include_both_ends(first, length, count, spacing):
    first = abs(first) + 1e-3 if spacing == "log" else first
    axis = Spaced("x", first, first + length, count, spacing)
    values = axis.at(np.arange(count))
    assert (values[0], values[-1]) == (first, first + length)
    assert (np.diff(values) > 0.0).all()


def test_log_draws_are_uniform_in_the_logarithm():
    draws = Drawn("x", 1e-3, 1e3, 4000, "log", 1).at(np.arange(4000))
    assert np.log10(draws).mean() == pytest.approx(0.0, abs=0.1)
    assert np.quantile(np.log10(draws), [0.25, 0.75]) == pytest.approx([-1.5, 1.5], abs=0.15)
    assert Spaced("x", 2.0, 32.0, 5, "log").at(np.array([1]))[0] == pytest.approx(4.0, rel=1e-15)


def test_start_depends_only_on_its_number():
    """Each start is within the spread, as high above the floor as the scene's own, and a valid state."""
    scene = load("drop-box-anyhow")
    body, spread, own = scene.body, scene.ensemble, scene.initial_state
    together = spread_starts(np.tile(own, (400, 1)), spread, np.arange(400), body.vertices, body.semi_axes, True)
    for number in (0, 7, 399):
        np.testing.assert_array_equal(together[number], spread_start(scene, number))
    for start in together[:50]:
        member = scene.starting_at(start)
        np.testing.assert_array_equal(member.initial_state, start)
        assert member.clearance == pytest.approx(scene.clearance, abs=1e-12)
    assert (np.abs(together[:, RATES] - own[RATES]) <= [*spread.velocity, *spread.angular_velocity]).all()


def test_starts_are_uniform_over_all_attitudes():
    """The mean of a rotation matrix over all attitudes is 0, its entries' squares 1/3 (4000 starts: ± .03)."""
    from dropspin.scenarios.rotations import rotate

    scene = load("drop-box-anyhow")
    own = np.tile(scene.initial_state, (4000, 1))
    drawn = spread_starts(own, scene.ensemble, np.arange(4000), scene.body.vertices, scene.body.semi_axes, True)
    for axis in np.eye(3):
        turned = rotate(drawn[:, ORIENTATION], axis)
        assert np.abs(turned.mean(axis=0)).max() < 0.03
        np.testing.assert_allclose((turned**2).mean(axis=0), 1 / 3, atol=0.03)


BALL = {"scenes": ["drop-ball"], "engines": ["wang"], "dts": [4e-3]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scenes": ["drop-bal"]}, "spec: scenes: scene 'drop-bal' is not in the catalogue .* Did you mean 'drop-ball'"),
        ({"scenes": ["drop-ball", "drop-ball"]}, "scenes: got .*; names one twice"),
        ({"scenes": []}, "scenes: got .*at least 1 item"),
        ({"engines": ["wnag"]}, "Did you mean 'wang'"),
        ({"engines": ["wang", "wang[law=note]"]}, "engines: the same engine is named twice, written in two ways"),
        ({"dts": []}, "the time step is missing"),
        ({"dts": [0.0]}, r"dts\[0\]: got 0.0; must be greater than 0"),
        ({"dts": [1.0]}, "dt: got 1.0 s; scene 'drop-ball' lasts 1.5 s"),
        ({"grid": {"dt": [1e-3]}}, "the time step is given twice"),
        ({"dts": [], "grid": {"dt": ["fast"]}}, "grid: dt: got 'fast'; a time step is a number above 0"),
        ({"seeds": 3}, r"seeds: scene 'drop-ball' has no \[ensemble\]"),
        ({"seeds": -1}, "seeds.*must be greater than"),
        ({"metrics": ["bounce_height_eror"]}, "Did you mean 'bounce_height_error'"),
        ({"metrics": ["penetration"]}, "'penetration' is measured in every sweep"),
        ({"repeat": 3}, "repeat: unknown key. Allowed: scenes, engines"),
        ({"grid": {"floor.restitution": [0.5, 1.5]}}, "grid: floor.restitution: .* got 1.5; must be less than or equal to 1"),
        ({"grid": {"floor.restitution": {"from": 0, "to": 2, "count": 3}}}, "grid: floor.restitution: .* got 2.0; must be less"),
        ({"grid": {"floor.restitution": {"from": 0, "to": 1}}}, "floor.restitution: count: missing"),
        (
            {"grid": {"floor.restitution": {"from": 1, "to": 0, "count": 3}}},
            "from 1 to 0 does not increase; 'to' must be greater than 'from'",
        ),
        ({"grid": {"floor.restitution": {"from": 0, "to": 1, "count": 3, "spacing": "log"}}}, "must start above 0"),
        ({"grid": {"floor.restitution": {"from": 0, "to": 1, "count": 1}}}, "count: got 1; must be greater than or equal to 2"),
        ({"grid": {"floor.restitution": 0.5}}, r"got 0.5; must be a list of values, or {from, to, count}"),
        ({"grid": {"floor.restitution": [0.5, 0.5]}}, "names a value twice"),
        ({"grid": {"floor.restitution": [1, 1.0]}}, "names a value twice"),
        ({"grid": {"floor.restitution": [0, -0.0]}}, "names a value twice"),
        ({"grid": {"floor.friction": ["none", 0.0]}}, "names a value twice"),
        ({"grid": {"start.position": [[0, 2, 0], [0.0, 2.0, 0.0]]}}, "names a value twice"),
        ({"grid": {"floor.restitution": [0.1], "floor": {"restitution": [0.5]}}}, "floor.restitution: is given twice"),
        ({"grid": {"engine.law": [[1, 2]]}}, "the value of an option is a word or a number"),
        (
            {"grid": {"engine.law": ["note"]}, "engines": ["wang[law=coulomb]"]},
            r"wang\[law=coulomb\] sets this option as well; leave it out there or here",
        ),
        ({"grid": {"body.mass": [10**400]}}, "got a whole number that exceeds the range"),
        *(
            ({table: fields}, f"got (a whole number that exceeds|a{kind} too large to be shown)")
            for kind, table, fields in (
                ("n? int", "grid", {"body.mass": 10**5000}),
                ("n? int", "grid", {"start.velocity": [[10**5000, 0, 0]]}),
                ("n? int", "grid", {"ensemble.seed": [10**5000]}),
                (" set", "grid", {"body.mass": [{10**5000}]}),
                ("n? int", "random", {"count": 2, "seed": 1, "body.mass": 10**5000}),
            )
        ),
        ({"grid": {"body.mass": [{"a": 1}]}}, "a value is a number, a word, or a list of them"),
        (
            {"grid": {"body.mass": {"from": 1e-300, "to": 1e30, "count": 3, "spacing": "log"}}},
            "exceeds the range of floating-point numbers",
        ),
        ({"grid": {"start.position[01]": [2.0]}}, "is not a valid field name"),
        ({"grid": {"dt": [float("inf")]}, "dts": []}, "got inf; a time step is a number above 0"),
        ({"grid": {"ensemble.turn": [0.5]}, "scenes": ["drop-box-anyhow"]}, "has an effect only with seeds"),
        ({"scenes": ["x\0.toml"]}, "this cannot be the name of a file"),
        ({"grid": {"floor.restitutoin": [0.5]}}, "Did you mean 'restitution'"),
        ({"grid": {"damping.linear": [0.5]}}, r"grid: damping.linear: scene 'drop-ball' has no \[damping\]"),
        ({"grid": {"flor.restitution": [0.5]}}, "grid: flor.restitution: no such field. Did you mean 'floor'"),
        ({"grid": {"summary": ["x"]}}, "grid: summary: no such field"),
        ({"grid": {"start.position[3]": [0.5]}}, "which has no entry 3"),
        ({"grid": {"body.mass[0]": [0.5]}}, "which has no entry 0"),
        ({"grid": {"body mass": [0.5]}}, "'body mass' is not a valid field name; write it as"),
        ({"grid": {"start.position[1]": [0.0]}}, "there the body is 0.1 m below the floor"),
        (
            {"grid": {"start.position": [[0, 2, 0]], "start.position[1]": [1.5]}},
            "is a part of start.position, which is swept as well; leave one of them out",
        ),
        ({"grid": {"engine.kappa": [0.1]}}, "wang's option 'kappa' is unknown"),
        ({"grid": {"engine.law": ["notes"]}}, "wang's law 'notes' is unknown. Did you mean 'note'"),
        ({"random": {"seed": 1, "body.mass": {"from": 1, "to": 2}}}, "random: count: missing"),
        ({"random": {"count": 2, "seed": 1}}, "random: no field is given; add one with its range"),
        ({"random": {"count": 2, "seed": 1, "body.mass": [1, 2]}}, "must be a range to draw from"),
        ({"random": {"count": 2, "seed": 1, "body.mass": {"from": 1, "to": 2, "count": 3}}}, "body.mass: count: unknown key"),
        (
            {"grid": {"body.mass": [1.0]}, "random": {"count": 2, "seed": 1, "body.mass": {"from": 1, "to": 2}}},
            r"body.mass: is in both \[grid\] and \[random\]",
        ),
        ({"random": {"count": 10**16, "seed": 1, "body.mass": {"from": 1, "to": 2}}}, "count: got 10000000000000000"),
        (
            {"random": {"count": 10**15, "seed": 1, "body.mass": {"from": 1, "to": 2}}, "dts": [1e-3, 2e-3]},
            r"the sweep has 2e\+15 jobs; at most 1e\+15 are allowed",
        ),
    ],
)
def test_spec_that_is_not_valid_is_refused_in_one_line(change, message):
    """The line says where, what was given, and what is allowed."""
    with pytest.raises(DropspinError) as error:
        load_sweep(BALL | change)
    assert re.search(message, str(error.value)), str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"floor.friction": [1, "none"]}, {"floor.friction": [1.0]}),
        ({"start.position": [[0, 2, 0]]}, {"start.position[1]": [2.0]}),
        ({"floor.friction": [0.0]}, {"floor.friction": ["none"]}),
        ({"start.velocity[0]": [-0.0]}, {"start.velocity[0]": [0]}),
    ],
)
def test_equivalent_values_have_the_same_key(one, other):
    keys = [hashes(load_sweep(BALL | {"engines": ["wang[law=coulomb]"], "grid": grid}), 0, 1) for grid in (one, other)]
    assert keys[0] == keys[1]


def test_value_that_is_valid_in_some_combination_is_accepted():
    """A tall box fits where it also starts higher; the jobs in which it does not fit report it in their rows."""
    grid = {"body.half_extents[1]": [0.1, 2.0], "start.position[1]": [0.7, 2.5]}
    assert load_sweep(BALL | {"scenes": ["drop-box-anyhow"], "grid": grid}).size == 4


def test_spec_of_the_documentation_is_valid(tmp_path):
    """docs/sweeps.md, with the number of jobs that it states."""
    page = (Path(__file__).parents[3] / "docs" / "sweeps.md").read_text(encoding="utf-8")
    (tmp_path / "spec.toml").write_text(page.split("```toml\n")[1].split("```")[0])
    size = load_sweep(tmp_path / "spec.toml").size
    assert size == 1 * 2 * 2 * 10 * 44 * 10
    assert f"= {size:,}." in page


def test_paths_of_scenes_are_relative_to_the_spec(tmp_path):
    (tmp_path / "mine.toml").write_text('duration = 1.0\n[body]\nshape = "sphere"\nradius = 0.1\nmass = 1.0\n')
    (tmp_path / "spec.toml").write_text('scenes = ["mine.toml"]\nengines = ["wang"]\ndts = [0.01]\n[grid]\nbody.mass = [1.0, 2.0]\n')
    assert load_sweep(tmp_path / "spec.toml").size == 2

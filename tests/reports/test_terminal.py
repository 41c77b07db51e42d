"""The summary of a run on a terminal, and tables as wide as it is."""

import re
from dataclasses import replace

import pandas as pd
import pytest
from support.cli import TERMINAL, dropspin

import dropspin as ds
from dropspin.reports.plots.colours import human_label
from dropspin.reports.stories.matrix import MOST_SCENES, shown_scenes
from dropspin.reports.stories.run import overview
from dropspin.reports.terminal.progress import share_bar
from dropspin.reports.terminal.rows import print_rows, print_sentence
from dropspin.reports.terminal.run_table import print_table

FINE = ("passed", "not judged (declined)")


@pytest.fixture(scope="module")
def core(core_run):
    """The default run: the scenes of the core catalogue of a stored run."""
    results = ds.load_results(core_run, arrays=False)
    scenes = {name: scene for name, scene in results.scenes.items() if "core" in scene.tags}
    return replace(results, scenes=scenes, table=results.table[results.table["scene"].isin(scenes)])


def repeated(results, times):
    """A run of several times as many scenes."""
    names = {f"{name}-{number}": (name, scene) for number in range(times) for name, scene in results.scenes.items()}
    tables = [results.table[results.table["scene"] == name].assign(scene=new) for new, (name, _) in names.items()]
    return replace(results, table=pd.concat(tables, ignore_index=True), scenes={new: scene for new, (_, scene) in names.items()})


def printed(results, capsys, width=80):
    from rich.console import Console

    print_table(results, Console(width=width, force_terminal=True, color_system=None), summary_only=True)
    return [line.strip() for line in capsys.readouterr().out.splitlines() if line.strip()]


def test_summary_of_the_default_run_has_at_most_48_lines_of_80_columns(core, capsys):
    """Two of them are blank; the path of the report follows."""
    lines = printed(core, capsys)
    assert len(core.scenes) == 28
    assert len(lines) <= 48
    assert max(map(len, lines)) <= 80
    head = next(number for number, line in enumerate(lines) if line.startswith("scene "))
    rows = lines[head + 2 : next(number for number, line in enumerate(lines) if line.startswith("✓"))]
    shown = [line.split()[0] for line in rows]
    assert shown == [scene for scene, found in core.statuses().items() if any(one.words not in FINE for one in found.values())]


@pytest.mark.extended
def test_summary_of_many_scenes_shows_those_with_findings_and_counts_the_others(core, capsys):
    many = repeated(core, 4)
    lines = printed(many, capsys)
    assert len(lines) <= 48
    shown = [line.split()[0] for line in lines[: next(number for number, line in enumerate(lines) if line.startswith("✓"))][2:]]
    assert len(shown) == MOST_SCENES
    fine, more = map(int, re.findall(r"\d+", shown_scenes(many.statuses())[1]))
    assert fine + more + MOST_SCENES == len(many.scenes)
    by_scene = core.statuses()
    without = [scene for scene, found in by_scene.items() if all(one.words in FINE for one in found.values())]
    assert fine == 4 * len(without) > 0
    assert not {name.rpartition("-")[0] for name in shown} & set(without)


@pytest.mark.extended
def test_cells_have_status_and_leading_error(core, capsys):
    """The mark is that of the one status; the number is in the results."""
    lines = {line.split()[0]: line for line in printed(core, capsys)}
    errors = core.measurements[(core.measurements["dt"] == 1e-3) & (core.measurements["metric"] == "orientation_error")]
    of = errors[errors["scene"] == "spin-asymmetric"].set_index("engine")["value"]
    assert lines["spin-asymmetric"].split()[1:] == [
        *("orientation,", "rad"),
        *(part for engine, mark in zip(core.engines, "†✓✓", strict=True) for part in (mark, f"{of[engine]:#.2g}")),
    ]
    assert lines["slide-box"].split()[:7] == ["slide-box", "position,", "%", "of", "0.47", "m", "–"]


@pytest.mark.extended
def test_row_shows_the_metric_of_the_largest_known_error(core, capsys):
    """Not the leading metric, in which the engine of the known error may be almost right."""
    line = next(line for line in printed(core, capsys) if line.startswith("drop-box-corner "))
    known = core.table[(core.table["scene"] == "drop-box-corner") & (core.table["verdict"] == "known") & (core.table["dt"] == 1e-3)]
    ratios = known[known["unit"].isin(["1", "rad"])].set_index("metric")["value"].abs()
    assert ratios.idxmax() == "orientation_error"
    assert line.split()[1:5] == ["orientation,", "rad", "†", f"{ratios.max():#.2g}"]


@pytest.mark.extended
def test_failing_scene_stays_when_others_are_left_out(core, capsys):
    """Whatever else there is to find; its failures follow with one command."""
    many = repeated(core, 2)
    passed = (many.table["verdict"] == "passed") & (many.table["kind"] == "truth")  # of failed asymptotic errors causes would be sought
    hit = (many.table["scene"] == "spin-principal-1") & (many.table["engine"] == "mujoco") & passed
    lines = printed(replace(many, table=many.table.assign(verdict=many.table["verdict"].mask(hit, "failed"))), capsys)
    [row] = [line for line in lines if line.startswith("spin-principal-1 ")]
    assert row.split()[5] == "✗"
    assert [line.split()[1] for line in lines if line.startswith("✗ ") and "failed" not in line] == ["spin-principal-1"]
    assert sum(line.startswith("Reproduce: dropspin run ") for line in lines) == 1


@pytest.mark.extended
@pytest.mark.parametrize("width", [60, 80, 160])
def test_matrix_of_many_engines_leaves_out_engines_before_it_breaks_a_number(core, capsys, width):
    """It names those that are left out."""
    labels = {"wang": "wang[rotation=implicit-gyroscopic]", "pybullet": "pybullet[coordinates=multibody]"}
    renamed = replace(
        core,
        engines=tuple(labels.get(engine, engine) for engine in core.engines),
        table=core.table.assign(engine=core.table["engine"].replace(labels)),
    )
    lines = printed(renamed, capsys, width)
    assert max(map(len, lines)) <= width
    text = " ".join(" ".join(lines).split())
    assert ("Columns not shown at this width: pybullet[coordinates=multibody]" in text) == (width <= 80)


@pytest.mark.extended
def test_each_engine_has_one_sentence_with_numbers_of_the_results(core):
    sentences = overview(core).findings
    of = {engine: [one for one in sentences if one.startswith(f"{human_label(engine)}: ")] for engine in core.engines}
    assert [len(some) for some in of.values()] == [1, 1, 1]
    known = core.table[(core.table["verdict"] == "known") & (core.table["unit"] == "rad") & (core.table["dt"] == 1e-3)]
    largest = known[known["value"] > 0.999 * known["value"].max()]
    assert set(largest["metric"]) == {"orientation_error"}
    scenes = " and ".join(largest["scene"])
    assert f"; largest error: orientation {largest['value'].max():.3g} rad at dt = 1 ms in {scenes}; " in of["wang"][0]
    assert "largest error: orientation" in of["pybullet"][0]  # a known limitation, in scenes whose slip turns
    for engine in core.engines:
        outcomes = [by_engine[engine].outcome for by_engine in core.statuses().values()]
        assert f" of {len(outcomes)} scenes; " in of[engine][0]
        for outcome in set(outcomes):
            assert f"{outcome} in {outcomes.count(outcome)}" in of[engine][0]
    assert of["wang"][0].endswith(" ns per step.")
    for engine in ("mujoco", "pybullet"):
        seconds, ratio = re.search(r"; ([\d.]+) µs per step, ([\d.]+) times that of Wang's method\.$", of[engine][0]).groups()
        fastest = float(re.search(r"([\d.]+) ns per", of["wang"][0])[1])
        assert float(ratio) * fastest == pytest.approx(1e3 * float(seconds), rel=0.1)


def test_piped_list_has_one_line_for_each_scene(tmp_path):
    lines = dropspin("list", cwd=tmp_path).stdout.splitlines()
    assert [line.split()[0] for line in lines] == ["scene", *ds.scene_names()]
    assert lines[0].split() == ["scene", "problem", "truth", "tags", "summary"]


def test_narrow_terminal_leaves_out_columns_and_names_them(tmp_path):
    text = dropspin("list", cwd=tmp_path, **TERMINAL).stdout
    assert max(map(len, text.splitlines())) <= 80
    assert "Columns not shown at this width: tags; use a wider terminal or --json." in text
    wide = dropspin("list", cwd=tmp_path, FORCE_COLOR="1", NO_COLOR="1", COLUMNS="200").stdout
    assert "tags" in wide
    assert "Not shown" not in wide


def test_table_keeps_numbers_whole(capsys, monkeypatch):
    """Columns are left out in the order given until the others fit."""
    for name, value in TERMINAL.items():
        monkeypatch.setenv(name, value)
    row = {
        "engine": "e" * 38,
        "error": "3.05e+00",
        "time": "49.1 ns",
        "least wanted": "9.87e-05 and more",
        "less wanted": "1.23e+04 in all",
    }
    print_rows([row], left_out_first=["least wanted", "less wanted"])
    text = capsys.readouterr().out
    assert {"3.05e+00", "1.23e+04"} <= set(text.split())
    assert "49.1 ns" in text
    assert "9.87e-05" not in text
    assert "Columns not shown at this width: least wanted; " in text


@pytest.mark.parametrize("width", range(24, 44))
def test_sentence_is_not_broken_between_a_number_and_its_unit(capsys, width):
    from rich.console import Console

    sentence = "For energy within 1 % use wang[rotation=midpoint] at 2 ms or less; 1 s of motion takes 94 µs or 4.8 ms."
    print_sentence(sentence, Console(width=width, force_terminal=True, color_system=None))
    lines = capsys.readouterr().out.splitlines()
    assert " ".join(lines) == sentence
    assert max(map(len, lines)) <= width
    assert not any(re.search(r"\d$", line) for line in lines[:-1])


def test_long_work_that_is_not_on_a_terminal_has_a_line_every_few_seconds(capsys, monkeypatch):
    now = iter([0.0, 3.0, 11.0, 12.0, 25.0])
    monkeypatch.setattr("dropspin.reports.terminal.progress.time.monotonic", lambda: next(now))
    with share_bar("a scene") as on_progress:
        for number in range(5):
            on_progress(f"part {number}", 0.2 * number)
    assert capsys.readouterr().err.splitlines() == [
        "working on a scene",
        "working on a scene: 40%, part 2",
        "working on a scene: 80%, part 4",
    ]

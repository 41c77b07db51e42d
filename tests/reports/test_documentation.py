"""The documentation, followed step by step: its commands are run, their output is compared with the page, and links are checked."""

import inspect
import re
import shlex
import sys
import tomllib
from pathlib import Path
from typing import get_args

import click
import pytest
from support import cli
from support.findings import PAGE, findings, heavy_engine, verify_findings

import dropspin as ds
from dropspin.reports.commands.main import dropspin
from dropspin.scenarios import bodies, model

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.usefixtures("all_start_phases")
PAGES = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "reference_impl" / "README.md"]
BLOCK = re.compile(r"^```(?P<kind>python|sh|text|diff)(?: title=\"(?P<file>[\w.]+)\")?\n(?P<content>.*?)^```$", re.DOTALL | re.MULTILINE)


def squeezed(text):
    """Text with single spaces, without the line breaks of a narrow terminal."""
    return " ".join(text.split())


def verify_output(output, shown):
    """The shown text is the whole output, but for what each … stands for."""
    pattern = re.escape(squeezed(shown)).replace("…", ".*")
    assert re.fullmatch(pattern, squeezed(output)), output


def changed(text, difference):
    """Text after a difference; the removed lines must occur once."""
    lines = difference.splitlines(keepends=True)
    old, new = ("".join(line[1:] for line in lines if line.startswith(sign)) for sign in "-+")
    assert text.count(old) == 1, old
    return text.replace(old, new)


def follow(page, folder, end=None):
    """Do what a page says, block after block up to a line, and return the exit code of each block of commands.

    The first command is the installed one, in its own process; the others run in this process.
    """
    output, file, codes = "", None, []
    for block in BLOCK.finditer((ROOT / "docs" / page).read_text(encoding="utf-8").partition(end or "\0")[0]):
        kind, content = block["kind"], block["content"]
        if kind == "python":
            file = folder / block["file"]
            file.write_text(content, encoding="utf-8")
        elif kind == "diff":
            file.write_text(changed(file.read_text(encoding="utf-8"), content), encoding="utf-8")
        elif kind == "sh":
            output = ""
            for program, *arguments in map(shlex.split, content.splitlines()):
                assert program == "dropspin"
                sys.modules.pop("my_engine", None)  # the file may have changed since the last command
                done = (cli.dropspin if codes else cli.spawn)(*arguments, cwd=folder, COLUMNS="200")
                assert "Traceback" not in done.stderr
                output += done.stdout
            codes.append(done.returncode)
        else:
            verify_output(output, content)
    return codes


@pytest.fixture
def _no_bytecode(monkeypatch):
    """Two versions of a module within one second would share their bytecode."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)


@pytest.mark.extended
@pytest.mark.usefixtures("_no_bytecode")
def test_tutorial_shows_the_output_and_exit_codes_of_its_commands(tmp_path):
    """The first check of the adapter fails, the second passes; run and accept pass; the change fails; without it all results hold."""
    codes = follow("tutorial.md", tmp_path)
    assert codes == [1, 0, 0, 0, 1, 0]
    assert (tmp_path / "out/ball/report.html").exists()


@pytest.mark.extended
def test_calibration_page_shows_the_output_of_its_first_command(tmp_path):
    """The second command, with `--as urdf`, takes longer; the tests of the command line run it."""
    assert follow("calibrate.md", tmp_path, end="dropspin calibrate -e pybullet") == [0]


@pytest.mark.slow
def test_page_on_choosing_a_step_shows_the_output_of_its_commands(tmp_path):
    assert follow("choose-a-step.md", tmp_path) == [0, 0]


def test_every_finding_on_the_page_on_engines_has_a_value_and_a_command():
    text = PAGE.read_text(encoding="utf-8")
    assert (
        sum(map(len, findings().values()))
        == len(re.findall("^- ", text, re.MULTILINE))
        == len(re.findall("`dropspin (?:run|symmetries twins) ", text))
    )


@pytest.mark.slow
@pytest.mark.parametrize("command", [command for command in findings() if not heavy_engine(command)])
def test_commands_of_the_page_on_engines_measure_the_values_printed_there(command, tmp_path):
    verify_findings(command, tmp_path)


@pytest.mark.extended
def test_python_of_the_readme_and_of_the_replay_page_runs(tmp_path, monkeypatch):
    """One after the other, in one namespace."""
    monkeypatch.chdir(tmp_path)
    names = {}
    for page in (ROOT / "README.md", ROOT / "docs" / "replay.md"):
        [block] = re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
        exec(compile(block, page.name, "exec"), names)
    assert (tmp_path / "out/corner/report.html").exists()
    assert (tmp_path / "corner.gif").exists()


@pytest.mark.extended
def test_python_of_the_reference_prints_what_the_page_shows(capsys):
    text = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    [(block, printed)] = re.findall(r"^```python\n(.*?)^```\n\nIt prints:\n\n```text\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    exec(compile(block, "python.md", "exec"), {})
    assert capsys.readouterr().out == printed


def test_scenes_of_the_pages_are_valid():
    of_readme, of_capsule, of_ball, of_box, of_wall = (
        ds.load(tomllib.loads(scene) | {"name": "mine"})
        for page in ("README.md", "docs/scenes.md")
        for scene in re.findall(r"^```toml\n(.*?)^```$", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    )
    assert of_readme.expect[0].metric == "bounce_height_error"
    assert ds.truth_for(of_capsule).events
    assert of_ball.damping.rates == pytest.approx({"linear": 0.0667, "angular": 1.35}, abs=5e-3)
    assert of_wall.wall[0].normal == (-1.0, 0.0, 0.0)
    assert of_box.body.inertia_tensor[0, 2] == 0.001


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_of_the_pages_exist_with_their_options(page):
    text = page.read_text(encoding="utf-8")
    lines = [line for block in BLOCK.finditer(text) if block["kind"] == "sh" for line in block["content"].splitlines()]
    lines += re.findall("^    (.+)$", text, re.MULTILINE)
    for line in [found[1] for line in lines if (found := re.match("dropspin (.+)", line))]:
        _, command, arguments = dropspin.resolve_command(click.Context(dropspin), shlex.split(line, comments=True))
        command.make_parser(click.Context(command)).parse_args(arguments)


def quoted_constants():
    """By page, phrases with the constants of the code that they quote."""
    from dropspin.comparisons.limits import runner
    from dropspin.comparisons.limits import study as limits
    from dropspin.comparisons.running.start_phases import START_PHASES
    from dropspin.comparisons.tradeoff import costs, ladder, pareto, study

    ladder = [
        f"exceeds `--budget` ({ladder.BUDGET:g} s)",
        f"with a floor, {ladder.MOST_RECORDED:,}",
        f"above {ladder.CONVERGED:g} of its largest",
    ]
    cost = [
        f"the median of {study.ROUNDS} rounds",
        f"less than a factor of {pareto.LEVEL:g}",
        f"in a batch of {costs.WORLDS[0]}",
        f"longer than {costs.LONGEST_BATCH:g} s",
    ]
    runs = [
        f"the time step `--dt` ({1e3 * limits.DT:g} ms)",
        f"`--within` ({limits.WITHIN:g})",
        f"more than {runner.MOST_STEPS_PER_START:,} time steps",
        f"more than {runner.MOST_ROWS:,} time steps",
    ]
    return {
        "choose-a-step.md": ladder + cost,
        "limits.md": [*runs, f"at least {runner.FEWEST_STEPS_WITHOUT_GRAVITY:,} time steps"],
        "figures.md": [f"means over {START_PHASES} *start phases*"],
        "verdicts.md": [f"run from {START_PHASES} start phases"],
    }


@pytest.mark.parametrize("page", quoted_constants())
def test_pages_quote_the_constants_of_the_code(page):
    text = squeezed((ROOT / "docs" / page).read_text(encoding="utf-8"))
    assert [phrase for phrase in quoted_constants()[page] if phrase not in text] == []


def test_reference_documents_every_public_name():
    text = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\.\. \S+:: dropspin\.(\w+)$", text, re.MULTILINE)) == ds.__all__


def rows_of(heading):
    """By the heading of its first column, the names in each table of a section of the page on adapters, without arguments."""
    section = (ROOT / "docs" / "bring-your-engine.md").read_text(encoding="utf-8").partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    tables = re.findall(r"^\| (.+?) \|.*\n\|---.*\n((?:\|.*\n)+)", section, re.MULTILINE)
    return {title: [name for row in rows.splitlines() for name in re.findall(r"`([\w.]+)", row.split(" | ")[0])] for title, rows in tables}


def public_members(kind):
    """The fields, properties and methods that a class of dropspin has, without private ones."""
    own = [base for base in kind.__mro__ if base.__module__.startswith(("dropspin.scenarios", "dropspin.comparisons"))]
    names = {name for base in own for name in [*vars(base), *inspect.get_annotations(base)]} - {"model_config"}
    return {name for name in names if not name.startswith("_")}


def test_page_on_adapters_documents_every_attribute_of_a_scene():
    """And no other; each once."""
    tables = {"start": [model.Start], "gravity": [model.Gravity], "floor": [model.Floor], "wall": [model.Wall], "damping": [model.Damping]}
    tables["body"] = list(get_args(bodies.Shapes))
    parts = {f"{table}.{name}" for table, kinds in tables.items() for kind in kinds for name in public_members(kind)}
    [names] = rows_of("What a scene holds").values()
    assert sorted(names) == sorted(public_members(ds.Scenario) - {"start", "body"} | parts)


def test_page_on_adapters_documents_every_member_of_the_protocol():
    """Those that are required are the abstract ones, and the name; an adapter does not define those that are left out."""
    kinds = (ds.Engine, ds.Simulation, ds.BatchSimulation)
    abstract = {f"{kind.__name__}.{name}" for kind in kinds for name in kind.__abstractmethods__}
    defined_by_dropspin = {"options", "option", "label", "is_default", "accuracy_levels", "refined", "represented_otherwise"}
    defined_by_dropspin |= {"steps_batches", "refusal", "given", "given_of", "options_in_force", "unmet_need", "calibrated"}
    defined_by_dropspin |= {"is_calibrated", "given_numbers", "without", "acting", "allows"}
    members = {f"{kind.__name__}.{name}" for kind in kinds for name in public_members(kind) - defined_by_dropspin}
    found = rows_of("The protocol")
    assert sorted(found["required"]) == sorted(abstract | {"Engine.name"})
    assert sorted(found["required"] + [name for name in found["optional"] if name != "dropspin.Diverged"]) == sorted(members)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_python_of_the_pages_uses_the_public_interface(page):
    """No block imports the packages behind it."""
    blocks = re.findall(r"^```python.*?\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert not any(re.search(r"^(import|from) .*\b(comparisons|scenarios)\b", block, re.MULTILINE) for block in blocks)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_existing_files_and_headings(page):
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", text):  # tests do not use the network
        file, _, heading = target.partition("#")
        named = page.parent / file if file else page
        assert named.exists() or named.name == "catalogue.md", target  # written by make docs
        if heading:
            headings = re.findall(r"^#+ (.+)$", named.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading in {re.sub(r"[^\w -]", "", one.lower()).replace(" ", "-") for one in headings}, target

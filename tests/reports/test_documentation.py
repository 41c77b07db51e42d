"""The documentation, followed word by word: what it says to type is typed, what it says will be seen is seen; links lead somewhere."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest

from reports.commands.main import dropspin
from scenarios import load

ROOT = Path(__file__).parents[2]
PAGES = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "reference_impl" / "README.md"]
BLOCK = re.compile(r"^```(?P<kind>python|sh|text|diff)(?: title=\"(?P<file>[\w.]+)\")?\n(?P<content>.*?)^```$", re.DOTALL | re.MULTILINE)


def squeezed(text):
    """Text with single spaces, whatever the width of a terminal made of it."""
    return " ".join(text.split())


def changed(text, difference):
    """Text after a difference: the lines that go are there once, and those that come are put in their place."""
    lines = difference.splitlines(keepends=True)
    old, new = ("".join(line[1:] for line in lines if line.startswith(sign)) for sign in "-+")
    assert text.count(old) == 1, old
    return text.replace(old, new)


def follow(page, folder):
    """Do what a page says, block after block."""
    said, file = "", None
    for block in BLOCK.finditer((ROOT / "docs" / page).read_text(encoding="utf-8")):
        kind, content = block["kind"], block["content"]
        if kind == "python":
            file = folder / block["file"]
            file.write_text(content, encoding="utf-8")
        elif kind == "diff":
            file.write_text(changed(file.read_text(encoding="utf-8"), content), encoding="utf-8")
        elif kind == "sh":
            path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
            done = subprocess.run(
                ["bash", "-c", content],
                cwd=folder,
                env=os.environ | {"PATH": path, "COLUMNS": "200"},
                capture_output=True,
                text=True,
                check=False,
            )
            assert "Traceback" not in done.stderr
            said = done.stdout
            yield done.returncode
        else:
            for line in content.splitlines():
                assert squeezed(line) in squeezed(said), said


def test_the_tutorial(tmp_path):
    """Two mistakes fail, mended they do not; the run passes; the harmless change fails the run and the check; without it all holds."""
    codes = list(follow("tutorial.md", tmp_path))
    assert codes == [1, 0, 0, 0, 1, 0]
    assert (tmp_path / "out/ball/report.html").exists()


def test_calibrating(tmp_path):
    assert list(follow("calibrate.md", tmp_path)) == [0, 0]


@pytest.mark.slow
def test_choosing_a_step(tmp_path):
    assert list(follow("choose-a-step.md", tmp_path)) == [0, 0]


def test_python_in_the_readme_and_of_the_replay(tmp_path, monkeypatch):
    """As they stand, one after the other."""
    monkeypatch.chdir(tmp_path)
    names = {}
    for page in (ROOT / "README.md", ROOT / "docs" / "replay.md"):
        [block] = re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
        exec(compile(block, page.name, "exec"), names)
    assert (tmp_path / "out/corner/report.html").exists()
    assert (tmp_path / "corner.gif").exists()


def test_the_readmes_scene():
    [scene] = re.findall(r"^```toml\n(.*?)^```$", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert load(tomllib.loads(scene) | {"name": "mine"}).expect[0].metric == "bounce_height_error"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_are_known(page):
    """Whatever a page says to type has verbs and options that there are."""
    text = page.read_text(encoding="utf-8")
    typed = [line for block in BLOCK.finditer(text) if block["kind"] == "sh" for line in block["content"].splitlines()]
    typed += re.findall("^    (.+)$", text, re.MULTILINE)
    for line in [found[1] for line in typed if (found := re.match("dropspin (.+)", line))]:
        verb, *arguments = shlex.split(line, comments=True)
        command = dropspin.commands[verb]
        command.make_parser(click.Context(command)).parse_args(arguments)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    """Files that are named are there, and headings in them too."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", text):  # nothing outside can be reached where tests run
        file, _, heading = target.partition("#")
        named = page.parent / file if file else page
        assert named.exists() or named.name == "catalogue.md", target  # which is made with the documentation
        if heading:
            headings = re.findall(r"^#+ (.+)$", named.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading in {re.sub(r"[^\w -]", "", one.lower()).replace(" ", "-") for one in headings}, target

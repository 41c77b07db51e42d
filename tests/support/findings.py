"""The findings on the page on engines, docs/engines.md: a sentence, a value and the command that measures it."""

import json
import re
import shlex
from pathlib import Path

from support import cli
from support.heavy_engines import CASES

PAGE = Path(__file__).parents[2] / "docs" / "engines.md"
FINDING = re.compile(
    r"^- .+: (?P<order>order of )?`(?P<name>[\w =]+)`(?: (?P<relation>[→<]))?(?: (?P<value>-?\d(?:[\d.]*\d)?(?:e-\d+)?))?(?: m| rad)?\.\\\n"
    r"  `dropspin (?P<command>(?:run|symmetries twins) .+)`$",
    re.MULTILINE,
)


def findings():
    """The findings by command."""
    by_command = {}
    for row in FINDING.finditer(PAGE.read_text(encoding="utf-8")):
        by_command.setdefault(row["command"], []).append(row)
    return by_command


def heavy_engine(command):
    """The name of the engine in a command that has an environment of its own; empty if it has none."""
    arguments = shlex.split(command)
    named = {arguments[at + 1].partition("[")[0] for at, argument in enumerate(arguments) if argument == "-e"}
    return "".join(named & CASES.keys())


def printed(done):
    """What a command printed as JSON."""
    assert done.stdout, done.stderr
    return json.loads(done.stdout)


def verify_twins(command, folder, run):
    """Run a command that compares two engines."""
    [found] = printed(run(*shlex.split(command), "--json", cwd=folder))
    for row in findings()[command]:
        measured = found[row["name"].replace(" ", "_")]
        assert measured < float(row["value"]) if row["relation"] else float(f"{measured:.1e}") == float(row["value"])


def verify_findings(command, folder, run=cli.dropspin):
    """Run a command: it measures the printed digits, at the finest time step or as dt → 0. A word is a verdict."""
    if command.startswith("symmetries twins"):
        verify_twins(command, folder, run)
        return
    results = printed(run(*shlex.split(command), "--json", "-o", "out", cwd=folder))
    finest = min((one["dt"] for one in results if one["dt"]), default=None)
    for row in findings()[command]:
        kinds = {"order"} if row["order"] else {"asymptotic_error"} if row["relation"] == "→" else {"truth", "invariant"}
        kinds = {"symmetry"} if "--symmetries" in command else kinds
        if row["value"] is None:
            assert {one["verdict"] for one in results} == {row["name"]}
            continue
        of_metric = [one for one in results if one["metric"] == row["name"] and one["kind"] in kinds]
        [measured] = [one["value"] for one in of_metric if one["dt"] in (finest, None)]
        if row["relation"] == "<":
            assert abs(measured) < float(row["value"])
        else:
            assert float(f"{measured:.1e}") == float(row["value"])

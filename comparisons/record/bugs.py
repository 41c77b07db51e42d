"""Known bugs of engines: public reports in `bugs.toml`, each simulated in the releases that it is about, and judged by a range.

The command of a case is run as a user would run it, each release in an environment of its own, which `prepare` makes and keeps.
"""

import math
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event
from typing import Literal, NamedTuple

from pydantic import BaseModel

from dropspin.comparisons.engines.options import engine_name
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.record.environments import installed, last_line, python_of, run, without_paths
from dropspin.comparisons.record.plan import load_plan
from dropspin.comparisons.results.store import load_results
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.parallel import as_done
from dropspin.scenarios import DropspinError
from dropspin.scenarios.errors import verify_known
from dropspin.scenarios.field_types import Table
from dropspin.scenarios.loading import read_toml

FILE = Path(__file__).with_name("bugs.toml")
READY = "ready"
"""The file that an environment has when its release is installed."""
State = Literal["shown", "not shown", "another value", "not run"]


class Bug(Table):
    """A public report.

    Attributes:
        name: Its name on the command line.
        reference: The address of the public thread.
        year: When it was reported.
        kind: The kind of fault.
        symptom: What goes wrong, in words.
        label: The engine with the options of the report; empty if no engine of dropspin has the fault.
        scene: A scene of the catalogue, or a TOML file beside this one.
        dt: The time step [s].
        metric: The metric that shows it.
        closed_form: The formula or the bound from which the range `fault` follows.
        fault: The least and the largest value of the metric with the fault.
        sound: The largest size of the metric without it.
        right_in: A scene of the catalogue that the fault leaves right: there the metric is not above `sound`; empty if none is needed.
        releases: Releases to run, oldest first: the first that has the fault, and the first without it, if there is one.
        silent: Why no check of the catalogue's scenes detects the fault; empty if one does.
        why_not: Why no scene can show it; empty if one can.
    """

    name: str
    reference: str
    year: int
    kind: str
    symptom: str
    label: str = ""
    scene: str = ""
    dt: float = 0.001
    metric: str = ""
    closed_form: str = ""
    fault: tuple[float, float] = (0.0, 0.0)
    sound: float = 0.0
    right_in: str = ""
    releases: tuple[str, ...] = ()
    silent: str = ""
    why_not: str = ""

    @property
    def engine(self) -> str:
        """The name of the engine without its options."""
        return engine_name(self.label)

    @property
    def is_of_catalogue(self) -> bool:
        """Whether its scene is one of the catalogue; a file is not."""
        return not self.scene.endswith(".toml")

    @property
    def arguments(self) -> list[str]:
        """The command that shows it, without `dropspin`."""
        scene = self.scene if self.is_of_catalogue else str(FILE.with_name("bugs") / self.scene)
        return ["run", scene, *filter(None, [self.right_in]), "-e", self.label, "--dt", f"{self.dt:g}", "--quick"]

    @property
    def command(self) -> str:
        """The command that shows it."""
        shown = [argument.replace(str(FILE.parents[2]), ".") for argument in self.arguments]
        return shlex.join(["dropspin", *shown])


class Outcome(BaseModel):
    """What one release did.

    Attributes:
        release: The release.
        state: Whether the value is that of the fault.
        value: The value of the metric; NaN if there is none.
        right: Its value in the scene that the fault leaves right; NaN if the report has none.
        said: What the command printed about the scene; or why it was not run.
    """

    release: str
    state: State
    value: float = math.nan
    right: float = math.nan
    said: str = ""


class Verdict(NamedTuple):
    """What the outcomes of a report are together.

    Attributes:
        kind: Whether the newest release shows it; `fixed` if only older ones do.
        since: The first release after those with the fault that does not show it; one with another value proves nothing.
    """

    kind: Literal["shown", "fixed", "not shown", "not expressible", "not run"]
    since: str = ""


def load_bugs(names: Iterable[str] = ()) -> list[Bug]:
    """The reports of some names, by default all.

    Raises:
        UnknownName: There is no report of a name.
    """
    listed = read_toml(FILE, FILE.name, "list of bugs")
    chosen = list(dict.fromkeys(names)) or list(listed)
    verify_known("case", chosen, listed)
    return [Bug.model_validate({"name": name, **listed[name]}) for name in chosen]


def state_of(bug: Bug, value: float, right: float = math.nan) -> State:
    """Whether a value of the metric is that of the fault, and the value in the scene that the fault leaves right is right."""
    least, most = bug.fault
    if bug.right_in and not abs(right) <= bug.sound:
        return "another value"
    if least <= value <= most:
        return "shown"
    return "not shown" if abs(value) <= bug.sound else "another value"


def verdict(bug: Bug, outcomes: Sequence[Outcome]) -> Verdict:
    """The verdict on a report, from what its releases did, oldest first."""
    if bug.why_not:
        return Verdict("not expressible")
    states = [outcome.state for outcome in outcomes]
    if not states or "not run" in states:
        return Verdict("not run")
    if states[-1] == "shown":
        return Verdict("shown")
    if "shown" in states and states[-1] == "not shown":
        last = len(states) - 1 - states[::-1].index("shown")
        return Verdict("fixed", outcomes[states.index("not shown", last)].release)
    return Verdict("not shown")


def prepare(bugs: Iterable[Bug], folder: Path, on_done: Callable[[str], None]) -> None:
    """Make the environments that reports need and that are not there yet.

    Args:
        bugs: The reports.
        folder: The folder of the environments.
        on_done: Called after each with its name, and why it could not be made if so.
    """
    for engine, release in dict.fromkeys((bug.engine, release) for bug in bugs for release in bug.releases):
        place = folder / f"{engine}-{release}"
        if _python(folder, engine, release):
            continue
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        planned = load_plan().engines[engine]
        try:
            installed(place, planned.package, planned.requirements(release), Event())
        except Breakdown as failure:
            on_done(f"{engine} {release}: {failure}")
            continue
        (place / READY).touch()
        on_done(f"{engine} {release}")


def _python(folder: Path, engine: str, release: str) -> str:
    """The Python that has a release: that which runs this, or that of an environment; empty if there is none."""
    with suppress(PackageNotFoundError):
        if version(load_plan().engines[engine].package) == release:
            return sys.executable
    place = folder / f"{engine}-{release}"
    return python_of(place) if (place / READY).exists() else ""


def measure(bugs: Collection[Bug], folder: Path, *, jobs: int, on_done: Callable[[Bug, Outcome], None]) -> dict[str, list[Outcome]]:
    """Run the command of each report in each of its releases.

    Args:
        bugs: The reports.
        folder: The folder of the environments.
        jobs: How many to run at a time.
        on_done: Called after each.

    Returns:
        The outcomes of each report, by its name, in the order of its releases.
    """
    stopping = Event()
    pieces = ((bug, release) for bug in bugs for release in bug.releases)
    outcomes: dict[tuple[str, str], Outcome] = {}
    with ThreadPoolExecutor(jobs) as pool:
        try:
            for (bug, release), outcome in filter(None, as_done(pool, lambda one: _outcome(*one, folder, stopping), pieces, lambda: jobs)):
                outcomes[bug.name, release] = outcome
                on_done(bug, outcome)
        finally:
            stopping.set()
    return {bug.name: [outcomes[bug.name, release] for release in bug.releases] for bug in bugs}


def _outcome(bug: Bug, release: str, folder: Path, stopping: Event) -> Outcome:
    """What a release does."""
    python = _python(folder, bug.engine, release)
    if not python:
        return Outcome(release=release, state="not run", said=f"no environment; dropspin bugs {bug.name} --prepare makes it")
    with TemporaryDirectory(prefix="dropspin-bug-") as output:
        code, printed = run([python, "-P", "-m", "dropspin", *bug.arguments, "-o", f"{output}/run", "-j", "1"], stopping)
        try:
            table = load_results(f"{output}/run", arrays=False).table
        except DropspinError:
            return Outcome(release=release, state="not run", said=f"exit code {code}: {without_paths(last_line(printed))}")
    measured = (table["metric"] == bug.metric) & table["kind"].isin(("truth", "invariant"))
    is_control, values = table["scene"] == bug.right_in, []
    for of_scene in (~is_control, is_control) if bug.right_in else (~is_control,):
        found = table[measured & of_scene]["value"].dropna()
        if found.empty:
            broken = table[of_scene & (table["reason"] != "")]["reason"]
            return Outcome(release=release, state="not run", said=str(broken.iloc[0]) if len(broken) else "it has no value")
        values.append(float(found.iloc[0]))
    [value, right] = values if bug.right_in else [*values, math.nan]
    failures = re.findall(r"^✗ ((\S+) · .+)$", printed, re.MULTILINE)
    said = [words for words, scene in failures if scene != bug.right_in]
    return Outcome(release=release, state=state_of(bug, value, right), value=value, right=right, said=said[0] if said else "")

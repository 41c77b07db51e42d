"""The sheets of the numbered problems, docs/problems/DS-….md, and their index docs/problems.md; as a program, it writes them.

A sheet is made from the file of the scene and from its exact solution. Tests compare it with what the code writes, and solve two of the
problems from their sheets alone.
"""

import math
from pathlib import Path

import numpy as np

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.scenarios import load, reference_for, truth_for
from dropspin.scenarios.problems import UNKNOWN, problems
from dropspin.scenarios.state import ORIENTATION, PARTS, RATES
from support.problem_statements import CONVENTIONS, KINDS, laws, number, statement

DOCS = Path(__file__).parents[2] / "docs"
INDEX = DOCS / "problems.md"
START, END = "<!-- index -->", "<!-- end -->"
DIGITS = 10
MOST_IMPACTS = 5
"""Impacts whose states are printed."""
UNITS = {"position": ("x", "m"), "orientation": ("q", ""), "velocity": ("v", "m/s"), "angular_velocity": ("ω", "rad/s")}
COMPONENTS = [(name, axis) for name, part in PARTS.items() for axis in "xyzw"[: part.stop - part.start]]


def write():
    """Write all sheets and the table of the index."""
    for problem in problems().values():
        sheet_path(problem).write_text(sheet(problem), encoding="utf-8")
    head, _, rest = INDEX.read_text(encoding="utf-8").partition(START)
    INDEX.write_text(f"{head}{START}\n\n{index_table()}\n\n{END}{rest.partition(END)[2]}", encoding="utf-8")


def sheet_path(problem):
    """The file of a problem's sheet."""
    return DOCS / f"problems/{problem.number}.md"


def index_table():
    """The table of all problems."""
    rows = [["problem", "scene", "subject", "exact solution"]]
    for problem in problems().values():
        scene = load(problem.scene)
        truth = reference_for(scene)
        known = UNKNOWN if truth is None else f"{truth.name}: {KINDS[truth.name]}"
        rows.append([f"[{problem.number}](problems/{problem.number}.md)", problem.scene, scene.summary, known])
    return table(rows)


def sheet(problem):
    """The sheet of a problem, Markdown."""
    scene = load(problem.scene)
    truth = None if scene.recording is not None else truth_for(scene)
    parts = [
        f"# {problem.number}: {scene.summary}",
        f"Problem {problem.identifier}, scene `{problem.scene}`, keywords: {', '.join(scene.tags)}. [All problems](../problems.md).",
        "## Statement",
        paragraph(CONVENTIONS),
        table([["", "value"], *map(list, statement(scene).items())]),
        "\n".join(f"- {law}" for law in laws(scene, truth)),
        "## Exact solution" if scene.recording is None else "## Recording",
        *(_solution(scene, truth) if scene.recording is None else _recording(scene)),
        "## Tolerance",
        paragraph(("" if truth is None else EXACT) + TOLERANCE + _energy(scene)),
        _tolerances(scene),
        "## Source",
        f"{scene.source}.",
        f"Run it with `dropspin run {problem.number}` or `dropspin run {problem.scene}`. The scene file is "
        f"`scenarios/catalogue/{problem.scene}.toml`; the digest of the definition is `{problem.digest}`.",
        f"Cite it as: The dropspin authors, *dropspin*, problem {problem.identifier} ({problem.scene}).",
    ]
    return "\n\n".join(parts) + "\n"


EXACT = (
    "A result counts as exact if each value differs from the printed one by at most one unit in the last decimal place of its quantity. "
)
TOLERANCE = """A numerical solution with the time step dt counts as correct if the absolute value of each metric in the table is within its
bound. The bounds are the same for every engine, and the scene file gives a reason for each. [How results are
computed](../figures.md) explains the metrics."""
ENERGY = """ The scene's energy is M |g| H or the kinetic energy at the start, whichever is larger. H is the height of the lowest point
above the floor at the start; if the body starts on the floor, H is the largest distance of its points from the centre of mass."""
FREE_ENERGY = " The scene's energy is the largest kinetic energy of the exact motion."


def _energy(scene):
    if not any("energy" in one.metric for one in scene.expect):
        return ""
    return FREE_ENERGY if scene.floor is None else ENERGY


def _solution(scene, truth):
    if truth is None:
        return ["No exact solution is known."]
    return [
        f"The solution is computed {KINDS[truth.name]}: {truth.statement}.",
        f"The table gives the state at four times. All components of a quantity (x, q, v or ω) have the same number of decimals: that with "
        f"which the largest of them, over all times of the table, has {DIGITS} significant digits. A component that rounds to 0 is "
        "written as 0.",
        _states(scene, truth),
        *_impacts(scene, truth),
        *_horizon(scene, truth),
    ]


def _recording(scene):
    tosses = scene.recording.tosses
    return [
        paragraph(
            f"""No exact solution is known. The file `scenarios/catalogue/{scene.name}.json` has {len(tosses)} measured tosses with
{sum(len(toss.t) for toss in tosses):,} frames in all. For each toss it has the times, positions and orientations of the frames, the
initial state, which is the state at the end of the measured flight, and 19 other initial states, drawn at random within the uncertainty
of this one. The initial state in the table above is that of the first toss. The value of a metric is a mean over the tosses.
Its uncertainty follows from the engine's results for the other initial states and from the measuring noise of a frame ([measured
motions](../measured.md))."""
        )
    ]


def _tolerances(scene):
    rows = [["metric", "dt [s]", "bound", "definition"]]
    for one in scene.expect:
        if one.engine is None:
            unit = "" if METRICS[one.metric].unit == "1" else f" {METRICS[one.metric].unit}"
            steps = ", ".join(map(number, one.dt)) if one.dt else "any"
            rows.append([one.metric, steps, f"≤ {number(one.below)}{unit}", METRICS[one.metric].definition])
    return table(rows)


def times(scene, truth):
    """The times of the printed states [s]: quarters of the motion, and the end of the scene if the solution is known until then."""
    end = min(scene.duration, truth.horizon)
    rest = rest_time(truth, end)
    moving = end if rest is None or rest > 0.5 * end else rest
    if moving < scene.duration:
        unit = 10.0 ** math.floor(math.log10(moving))
        moving = math.floor(moving / unit) * unit
    quarters = [round(share * moving, 9) for share in (0.25, 0.5, 0.75, 1.0)]
    return [*quarters[:-1], end] if end == scene.duration else quarters


def rest_time(truth, end):
    """The time from which on the body lies still after impacts [s]; None if it does not."""
    still = truth.events and truth.events[-1].time > 0.0 and not truth([end]).states[0, RATES].any()
    return truth.events[-1].time if still else None


def _states(scene, truth):
    at = times(scene, truth)
    columns = [[f"t = {number(t)} s" for t in at], *printed(truth(at).states).T]
    return table([["", *columns[0]], *([name, *values] for name, values in zip(_names(), columns[1:], strict=True))])


def _names():
    return [f"{UNITS[name][0]}_{axis}{f' [{UNITS[name][1]}]' if UNITS[name][1] else ''}" for name, axis in COMPONENTS]


def printed(states):
    """The components of states, shape (n, 13), as texts.

    Each quantity has as many decimals as give its largest component ten digits; quaternions have the sign that makes w positive.
    """
    texts = np.empty(states.shape, dtype=object)
    for name, part in PARTS.items():
        values = states[:, part]
        decimals = decimals_of(values)
        if name == "orientation":
            values = np.array([_positive(np.round(value, decimals), value) for value in values])
        texts[:, part] = [[decimal(value, decimals) for value in row] for row in values]
    return texts


def _positive(rounded, quaternion):
    """The quaternion or its opposite, whichever has a positive last component that is not 0."""
    return quaternion * math.copysign(1.0, rounded[np.flatnonzero(rounded)[-1]])


def decimals_of(values):
    """The number of decimals that gives the largest of some values ten significant digits."""
    largest = float(np.abs(values).max())
    return DIGITS - 1 - (math.floor(math.log10(largest)) if largest else 0)


def decimal(value, decimals):
    """A value with some decimals; 0 without."""
    text = f"{value:.{decimals}f}"
    return text if float(text) else "0"


def _impacts(scene, truth):
    """The paragraphs on impacts: their number, the time of rest, and a table of the first few."""
    events = [event for event in truth.events if event.time > 0.0]
    if not events:
        return []
    end = min(scene.duration, truth.horizon)
    rest = rest_time(truth, end)
    if rest is not None:
        text = f"The body lies still from t = {decimal(rest, decimals_of(np.array([rest])))} s on."
    else:
        count = f"are {len(events)} impacts" if len(events) > 1 else "is 1 impact"
        text = f"Until t = {number(round(end, 6))} s there {count}."
    shown = events[:MOST_IMPACTS]
    first = f"the first {MOST_IMPACTS} impacts" if len(events) > MOST_IMPACTS or rest is not None else "all impacts"
    return [f"{text} The table gives {first}, without the components that are 0 in all of them:", table(_impact_rows(scene, truth, shown))]


def _impact_rows(scene, truth, events):
    before, after = np.split(printed(np.array([getattr(event, side) for side in ("before", "after") for event in events])), 2)
    moments = np.array([event.time for event in events])
    rows = [["impact", *map(str, range(1, len(events) + 1))], ["t [s]", *(decimal(t, decimals_of(moments)) for t in moments)]]
    for column, name in enumerate(_names()):
        sides = [(name, before)] if column < ORIENTATION.stop else [(f"{name}, before", before), (f"{name}, after", after)]
        rows += [[text, *states[:, column]] for text, states in sides if any(value != "0" for value in states[:, column])]
    if truth.name == "bounce-ladder":
        heights = np.array([event.after[8] ** 2 / (-2.0 * scene.acceleration[1]) for event in events])
        rows.append(["rebound height [m]", *(decimal(height, decimals_of(heights)) for height in heights)])
    return rows


def _horizon(scene, truth):
    if truth.covers_all(scene.duration):
        return []
    return [
        f"The exact solution is known until t = {truth.horizon:.4f} s, because then {truth.ends}. The laws above hold at later times too. "
        "In flight, the energy, the horizontal velocity and the angular momentum about the centre of mass are therefore constant; in an "
        "impact, the angular momentum about the striking point is constant."
    ]


def paragraph(text):
    """A text without its line breaks."""
    return " ".join(text.split())


def table(rows):
    """Rows as a Markdown table; the first row is the head."""
    cells = [[str(cell).replace("|", "\\|") for cell in row] for row in rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in [cells[0], ["---"] * len(cells[0]), *cells[1:]])


if __name__ == "__main__":
    write()

"""How often the interval of an asymptotic error is right: `make coverage`, which writes docs/coverage.md.

Synthetic series have an asymptotic error m by construction.
"""

import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.judging.error_budget import error_budget, vector_budget
from support.error_series import FAMILIES, HELD_OUT, OTHERS, PLAIN, Series
from support.misleading_series import HELD_OUT_KINDS, KINDS, STEPS, steps_of

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
SERIES = 500
LARGE = 0.5
"""An asymptotic error larger than this share of the coarsest step's error is large."""


class Outcome(NamedTuple):
    """One series: its asymptotic error, whether the interval contains it, the cause, and sizes relative to the finest error."""

    asymptotic: float
    is_covered: bool
    cause: str
    width: float
    is_large: bool


def outcome(series: Series, dts: Array) -> Outcome:
    """What the error budget says about a series."""
    if series.errors.ndim == 1:
        found, sizes = error_budget(dts, series.errors, resolution=series.noise or None, signed=series.signed), np.abs(series.errors)
    else:
        found = vector_budget(dts, series.errors, None, np.full_like(series.errors, series.noise), np.zeros_like(dts), 0.0)
        sizes = np.linalg.norm(series.errors, axis=1)
    usable = sizes[np.isfinite(sizes)]
    coarsest, finest = (float(usable[end]) for end in (0, -1)) if len(usable) else (math.nan, math.nan)
    slack = 1e-9 * float(np.nanmax(sizes, initial=0.0))
    is_covered = found.lower - slack <= series.asymptotic <= found.upper + slack
    width = (found.upper - found.lower) / finest if finest else math.nan
    return Outcome(series.asymptotic, is_covered, found.cause, width, abs(series.asymptotic) > LARGE * coarsest)


SMALL, COMPARABLE = 1e-3, 0.1
"""The smallest asymptotic errors that are not 0, relative to the leading term."""


def outcomes(name: str, count: int, steps: int | str, least: float = SMALL) -> list[Outcome]:
    """What the error budget says about many series of a family; those that give no interval are left out."""
    of_steps = steps.encode() if isinstance(steps, str) else [steps]
    rng, h = np.random.default_rng([*of_steps, round(1.0 / least), *name.encode()]), _steps(name, steps)
    draw = {**FAMILIES, **OTHERS, **HELD_OUT, **KINDS, **HELD_OUT_KINDS}[name]
    found = [outcome(draw(rng, h, least), 4e-3 * h) for _ in range(count)]
    return [one for one in found if not math.isnan(one.width)]


def _steps(name: str, steps: int | str) -> Array:
    """Time steps relative to the coarsest."""
    return STEPS[f"{steps} uneven" if name in HELD_OUT else str(steps)]


def row(name: str, steps: str, found: list[Outcome]) -> list[str]:
    """A row of the table."""
    decided = [one for one in found if one.cause != "unresolved"]
    zeros, large = [one for one in found if one.asymptotic == 0.0], [one for one in found if one.is_large]
    shares = [
        _share(one.is_covered for one in found),
        _share(one.is_covered for one in decided),
        _share(one.cause == "unresolved" for one in found),
        _share(one.cause == "model" for one in zeros),
        _share(one.cause == "discretisation" for one in large),
    ]
    return [name, steps, str(len(found)), *shares, f"{np.nanmedian([one.width for one in found]):.2g}"]


def _share(hits: Iterator[bool]) -> str:
    counted = list(hits)
    return f"{100.0 * np.mean(counted):.1f} %" if counted else "–"


HEAD = ["family", "time steps", "series", "covered", "of those decided", "unresolved", "false model", "large missed", "median width"]
TABLES = {
    "Asymptotic errors from a thousandth of the leading term": ((*FAMILIES, *OTHERS), SMALL),
    "Asymptotic errors from a tenth of the leading term": ((*FAMILIES, *OTHERS), COMPARABLE),
    "Held-out families, at time steps that are not halved": (tuple(HELD_OUT), COMPARABLE),
}


FURTHER_TABLES = {"Series that mislead an extrapolation": KINDS, "Held-out series that mislead an extrapolation": HELD_OUT_KINDS}


def main() -> None:
    """Print the tables and write them to docs/coverage.md."""
    from support import engine_coverage  # which uses this module's outcomes

    lines: list[str] = []
    with ProcessPoolExecutor() as pool:
        for title, (names, least) in TABLES.items():
            jobs = [(name, steps, least) for name in names for steps in (3, 5)]
            found = dict(zip(jobs, pool.map(_outcomes_of, jobs), strict=True))
            rows = [row(name, str(steps), some) for (name, steps, _), some in found.items()]
            rows += [_sum(found, names, steps, "all families") for steps in (3, 5)]
            rows += [_sum(found, PLAIN, steps, "all plain families") for steps in (3, 5) if PLAIN[0] in names]
            lines += ["", f"## {title}", "", *_table(rows)]
        for title, kinds_of_series in FURTHER_TABLES.items():
            jobs = [(name, steps, SMALL) for name in kinds_of_series for steps in steps_of(name)]
            rows = [row(name, steps, some) for (name, steps, _), some in zip(jobs, pool.map(_outcomes_of, jobs), strict=True)]
            lines += ["", f"## {title}", "", *_table(rows)]
        kinds = [kind.title for kind in engine_coverage.KINDS]
        engines = zip(kinds, pool.map(engine_coverage.outcomes, kinds, [engine_coverage.RUNS] * len(kinds)), strict=True)
        lines += [
            "",
            "## Engines with one wrong parameter",
            "",
            *_table(row(kind, "3, 5", [one for _, one in some]) for kind, some in engines),
        ]
    sys.stdout.write("\n".join(lines) + "\n")
    page = ROOT / "docs/coverage.md"
    text = page.read_text(encoding="utf-8")
    start, end = text.index("<!-- table -->"), text.index("<!-- end -->")
    page.write_text(text[:start] + "<!-- table -->" + "\n".join(lines) + "\n" + text[end:], encoding="utf-8")


def _table(rows: Iterable[list[str]]) -> list[str]:
    return ["| " + " | ".join(cells) + " |" for cells in (HEAD, ["---"] * len(HEAD), *rows)]


def _outcomes_of(job: tuple[str, int | str, float]) -> list[Outcome]:
    name, steps, least = job
    return outcomes(name, SERIES, steps, least)


def _sum(found: Mapping[tuple[str, int, float], list[Outcome]], names: Sequence[str], steps: int, title: str) -> list[str]:
    """A row for the series of several families together."""
    return row(title, str(steps), [one for (name, of, _), some in found.items() if name in names and of == steps for one in some])


if __name__ == "__main__":
    main()

"""The output of `dropspin reproduce`: published values beside those found here, source by source."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, fields
from itertools import groupby
from typing import Any, get_args

from dropspin.comparisons.judging.verdicts import BREAKDOWNS
from dropspin.comparisons.published.results import Result, Status
from dropspin.comparisons.published.sources import Source
from dropspin.scenarios.text import counted

COLUMNS = tuple(field.name for field in fields(Result))
STATUSES: tuple[Status, ...] = get_args(Status)
WORDS: dict[Status, str] = {"differs": "differs by", "error of the source": "error"}
"""The word before a difference, by status."""
LEGEND = (
    "Reproduced: the value has the digits that the source prints. Within: it is within the bound or the tolerance that the source states, "
    "and counts as reproduced. Error: that of the published value, beside the exact solution. For comparison: not in the source."
)


def rows(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Every result; numbers that are not finite are None."""
    return [
        {name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in asdict(one).items()}
        for one in results
    ]


def heading(source: Source) -> list[str]:
    """The title, the citation and the setting of a source."""
    return [f"{source.name}: {source.title}", f"Source: {source.citation}; {source.place} (licence: {source.licence}).", source.setting]


def table(results: Sequence[Result]) -> list[dict[str, str]]:
    """The results of one source: a row for each tool and what gave its values here, and below it one for each value."""
    found = []
    for (tool, by), group in groupby(results, key=lambda one: (one.tool, one.by)):
        found.append({"result": f"{tool}: {by}" if by else tool, "published": "", "here": "", "verdict": ""})
        found += [
            {"result": f"- {one.quantity}", "published": one.published, "here": one.here or "–", "verdict": _verdict(one)} for one in group
        ]
    return found


def _verdict(one: Result) -> str:
    if one.status == "reproduced" and set(one.published) & set("<>≤±"):
        return "within"
    word = WORDS.get(one.status, one.status)
    return f"{word} {one.difference:.1e}" if one.status in WORDS and math.isfinite(one.difference) else word


def notes(source: Source, results: Sequence[Result]) -> list[str]:
    """Why engines give the values of a source, why others cannot, and the remarks on the source."""
    reasons = [(group.tool, group.by, group.why) for group in source.groups if group.why]
    reasons += [(one.tool, one.by, f"{one.status}: {one.reason.removesuffix('.')}") for one in results if one.reason]
    return [*(f"{tool}, {by}: {why}." if by else f"{tool}: {why}." for tool, by, why in dict.fromkeys(reasons)), *source.remarks]


def summary(results: Sequence[Result]) -> list[dict[str, str]]:
    """The number of results of each status for each source, and their sums."""
    present = [status for status in STATUSES if any(one.status == status for one in results)]
    names = list(dict.fromkeys(one.source for one in results))
    counts = {name: Counter(one.status for one in results if one.source == name) for name in names}
    counts |= {"all": Counter(one.status for one in results)} if len(names) > 1 else {}
    return [{"source": name, **{status: str(count[status]) for status in present}} for name, count in counts.items()]


def verdict(results: Sequence[Result]) -> str:
    """Whether everything that is claimed to be reproducible is."""
    counts = Counter(one.status for one in results)
    claimed = counts["reproduced"] + counts["differs"]
    not_run = f"; {counted(counts['not run'], 'was', 'were')} not run" if counts["not run"] else ""
    are = "is" if 1 in (counts["reproduced"], claimed) else "are"
    reproduced = f"{counts['reproduced']} of {counted(claimed, 'value')} {are} reproduced"
    return f"{reproduced}; {counted(counts['differs'], 'differs', 'differ')}{not_run}."


def exit_code(results: Sequence[Result]) -> int:
    """1 if a value differs that is claimed to be reproducible, 3 if an engine broke down, otherwise 0."""
    if any(one.status == "differs" for one in results):
        return 1
    return 3 if any(one.verdict in BREAKDOWNS for one in results) else 0

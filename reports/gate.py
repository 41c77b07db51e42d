"""What a check against accepted figures came to: sentences, a Markdown summary, and annotations."""

import os
import shlex
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import pandas as pd

from comparisons import Results
from comparisons.provenance import versions_behind
from comparisons.regressions.baseline import Baseline
from comparisons.regressions.checking import ANOTHER_SCENE, KNOWN, Checked
from comparisons.regressions.figures import figures, of_engines_that_broke_down, regressed
from comparisons.verdicts import BREAKDOWNS, FAILURES
from reports.failing import Failing
from reports.findings import counts as counts_of
from reports.findings import verdict_sentence
from reports.html import page

AT_MOST = 12
"""How many of what failed are told one by one where people read; JUnit and JSON have them all."""
IN_SUMMARY = 100
JUDGED = FAILURES | BREAKDOWNS | {"passed", "missing"}
ANNOTATIONS = 10
"""As many as GitHub shows of one step."""


class Held(NamedTuple):
    """What a run is held against: the accepted figures and their file; and the folder of the run, for the commands."""

    baseline: Baseline
    path: str
    run: str

    @property
    def to_accept(self) -> str:
        """The command that accepts the run's figures."""
        return shlex.join(["dropspin", "accept", self.run, "--baseline", self.path, "--reason"]) + ' "…"'


def sentences(checked: Checked, held: Held | None) -> list[str]:
    """What came of a check, the verdict last."""
    own = _without_baseline(checked.results)
    known = own.frame["reason"].str.startswith(KNOWN).sum()
    told = "" if known and not own.frame["verdict"].isin(JUDGED).any() else verdict_sentence(own)
    if held is None:
        return [told]
    found = checked.changes
    rows = checked.results.frame[(checked.results.frame["kind"] == "baseline") & (checked.results.frame["verdict"] == "failed")]
    listed = [_of_engine(str(engine), some, found) for engine, some in rows.groupby("engine", sort=False)]
    if len(rows):
        listed += _since_then(checked, held.baseline)
    if not (of_engines_that_broke_down(rows, checked.results) & (rows["metric"] == "")).all():
        listed.append(f"If that is as it should be from now on: {held.to_accept}")
    better, new = (found[found["change"] == change] for change in ("better", "new"))
    if len(better):
        listed.append(f"{_count(better, 'figure')} better than accepted; to hold engines to that from now on: {held.to_accept}")
    if len(new):
        listed.append(f"{_count(new, 'figure')} new, and not accepted yet: {held.to_accept}")
    if len(checked.not_run):
        where = checked.not_run.drop_duplicates(["scene", "engine"])
        listed.append(f"{len(checked.not_run):,} accepted figures were not run, of {len(where)} pairs of a scene and an engine.")
    if known:
        listed.append("1 check fails as it was known to." if known == 1 else f"{known:,} checks fail as they were known to.")
    failed = len(regressed(found))
    judged = int(found["change"].isin(["same", "better"]).sum()) + failed
    other = rows.loc[rows["reason"].str.startswith(ANOTHER_SCENE), "scene"].nunique()
    if other:
        listed.append(f"{other} {'scene simulates' if other == 1 else 'scenes simulate'} something else than when figures were accepted.")
    if failed or other:
        return [*listed, f"{failed:,} of {judged:,} accepted figures fail. {told}".rstrip()]
    return [*listed, f"{told} All {judged:,} accepted figures hold.".lstrip() if judged else told]


def summary(checked: Checked, held: Held | None, found: Sequence[Failing]) -> str:
    """The same as Markdown that fits a comment on a pull request."""
    results = checked.results
    return page(
        "check.md",
        sentences=sentences(checked, held),
        failing=found[:IN_SUMMARY],
        more=max(0, len(found) - IN_SUMMARY),
        shown=AT_MOST,
        engines=results.engines,
        tallies={engine: _tally(results.frame[results.frame["engine"] == engine]) for engine in results.engines},
        versions=versions_behind(results.provenance),
        cpu=results.provenance["cpu"],
    )


def accepted_sentences(results: Results, found: pd.DataFrame, known_failures: bool) -> list[str]:
    """What was accepted of a run, and what was not."""
    counts = found["change"].value_counts()
    told = ", ".join(f"{counts[change]:,} {change}" for change in ("new", "worse", "moved", "better", "gone", "same") if change in counts)
    named = ", ".join(results.engines)
    listed = [f"Accepted of {len(results.scenes)} {'scene' if len(results.scenes) == 1 else 'scenes'} with {named}: {told or 'nothing'}."]
    tally = counts_of(results)
    if tally.failed and not known_failures:
        listed.append(
            f"{tally.failed:,} checks of this run fail, and will fail dropspin check, whatever is accepted; "
            "--known-failures accepts them as known."
        )
    unknown = tally.failed - int(figures(results)["verdict"].isin(FAILURES).sum())
    if unknown and known_failures:
        checks = "1 check fails" if unknown == 1 else f"{unknown:,} checks fail"
        listed.append(f"{checks} without a figure that can be held, and cannot be accepted as known.")
    if tally.broken:
        listed.append(f"{tally.broken:,} runs of an engine broke down; what was accepted of them before stays.")
    return listed


def annotations(found: Sequence[Failing]) -> list[str]:
    """Commands by which GitHub shows failures beside a run, where the check runs there."""
    if os.environ.get("GITHUB_ACTIONS") != "true":
        return []
    return [
        f"::error title={_escaped(f'{one.scene} {one.engine}', ':,')}::{_escaped(f'{one.sentence}. Again: {one.again}')}"
        for one in found[:ANNOTATIONS]
    ]


def _without_baseline(results: Results) -> Results:
    held = (results.frame["kind"] != "baseline").to_numpy()
    return replace(results, frame=results.frame[held], tolerances=results.tolerances[held])


def _of_engine(engine: str, rows: pd.DataFrame, found: pd.DataFrame) -> str:
    """Where figures of an engine fail, and what has moved most."""
    scenes = rows["scene"].nunique()
    total = len({*found.loc[found["engine"] == engine, "scene"], *rows["scene"]})
    measured = rows[rows["value"].notna()]
    most = ""
    if len(measured):
        metric = measured["metric"].iloc[0]
        where = measured.loc[measured["metric"] == metric, "scene"].unique()
        most = f"; most of all {metric.replace('_', ' ')} in {', '.join(where[:3])}{' …' if len(where) > 3 else ''}"
    return f"{engine}: accepted figures fail in {scenes} of {total} scenes{most}."


def _since_then(checked: Checked, baseline: Baseline) -> list[str]:
    """Which versions are others than when the figures that fail were accepted."""
    now = versions_behind(checked.results.provenance)
    moved = checked.changes[checked.changes["change"].isin(["worse", "moved", "gone"])]
    differ = [
        f"{name} {then} → {now[name]}"
        for by in moved["by"].dropna().unique()
        for name, then in baseline.acceptances[by].versions.items()
        if name in now and now[name] != then
    ]
    listed = ", ".join(dict.fromkeys(differ))
    return [f"Since they were accepted: {listed}."] if differ else []


def _tally(rows: pd.DataFrame) -> dict[str, int]:
    """How many checks of an engine passed, failed, and so on."""
    return {str(verdict): int(count) for verdict, count in rows["verdict"].value_counts().items()}


def _count(rows: pd.DataFrame, what: str, one: str = "is", many: str = "are") -> str:
    return f"{len(rows):,} {what}{'' if len(rows) == 1 else 's'} {one if len(rows) == 1 else many}"


def _escaped(text: str, more: str = "") -> str:
    """As GitHub's commands want it; % first."""
    for sign in f"%\r\n{more}":
        text = text.replace(sign, f"%{ord(sign):02X}")
    return text

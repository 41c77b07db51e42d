"""The output of `dropspin check` and `accept`: sentences, and annotations for GitHub."""

import os
import shlex
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import pandas as pd

from dropspin.comparisons.judging.verdicts import BREAKDOWNS, FAILURES
from dropspin.comparisons.regressions.baseline import Baseline
from dropspin.comparisons.regressions.checking import Checked
from dropspin.comparisons.regressions.values import broke_down, comparable_results, regressed
from dropspin.comparisons.results.results import Results
from dropspin.reports.views.failures import Failure
from dropspin.reports.views.findings import counts, verdict_sentence
from dropspin.reports.views.numbers import failing
from dropspin.scenarios.text import counted

JUDGED = FAILURES | BREAKDOWNS | {"passed", "missing"}
MOST_ANNOTATIONS = 10
"""The number of annotations that GitHub shows for one step."""


class BaselineFile(NamedTuple):
    """A baseline, its file, and the folder of the run that is compared with it, as they appear in printed commands."""

    baseline: Baseline
    path: str
    run: str

    @property
    def accept_command(self) -> str:
        """The command that accepts the run's results."""
        return shlex.join(["dropspin", "accept", self.run, "--baseline", self.path, "--reason"]) + ' "…"'


def scope(file: BaselineFile | None) -> str:
    """A sentence on what was checked."""
    if file is None:
        return "Checked: the expectations of the scenes only, without a baseline."
    return f"Checked: the expectations of the scenes, and the accepted results in {file.path}."


def sentences(checked: Checked, file: BaselineFile | None) -> list[str]:
    """The outcome of a check, the verdict last."""
    own = _without_baseline(checked.results)
    known = int((own.table["basis"] == "accepted_failure").sum())
    verdict = "" if known and not own.table["verdict"].isin(JUDGED).any() else verdict_sentence(own, counts(own))
    if file is None:
        return [verdict]
    table = checked.results.table
    failed_rows = table[(table["kind"] == "baseline") & (table["verdict"] == "failed")]
    listed = [*_attributed(checked), *_notes(checked, known)]
    better, new = (int((checked.changes["change"] == change).sum()) for change in ("better", "new"))
    acceptable = bool((~(broke_down(failed_rows, checked.results) & (failed_rows["metric"] == ""))).any())
    if acceptable or better or new:
        listed.append(f"If the changes are intended: {file.accept_command}")
    return [*listed, _verdict(checked, failed_rows, verdict)]


def _notes(checked: Checked, known: int) -> list[str]:
    """Sentences on improvements, new results, accepted results that the run does not cover, and known failures."""
    better, new = (int((checked.changes["change"] == change).sum()) for change in ("better", "new"))
    notes = [
        f"{counted(count, 'result is', 'results are')} {what}."
        for count, what in ((better, "better than accepted"), (new, "new and not yet accepted"))
        if count
    ]
    if len(checked.not_run):
        pairs = len(checked.not_run.drop_duplicates(["scene", "engine"]))
        are = counted(len(checked.not_run), "accepted result is", "accepted results are")
        notes.append(f"{are} not covered by this run ({counted(pairs, 'scene–engine pair')}).")
    if known:
        notes.append(f"{counted(known, 'known failure')}, not counted as failed.")
    return notes


def _verdict(checked: Checked, failed_rows: pd.DataFrame, own: str) -> str:
    """The last sentence: the verdict on the run's own checks and on the accepted results."""
    failed = len(regressed(checked.changes))
    judged = int(checked.changes["change"].isin(["same", "better"]).sum()) + failed
    changed = failed_rows.loc[failed_rows["basis"] == "scene_changed", "scene"].nunique()
    scenes = f"{counted(changed, 'scene has', 'scenes have')} changed since results were accepted. " if changed else ""
    if failed or changed:
        those = f"{failing(failed, judged, 'accepted result')}." if judged else "No accepted result was compared."
        return f"{scenes}{those} {own}".rstrip()
    hold = "The accepted result holds" if judged == 1 else f"All {judged:,} accepted results hold"
    return f"{own} {hold}.".lstrip() if judged else own


def accepted_sentences(results: Results, found: pd.DataFrame, known_failures: bool) -> list[str]:
    """Sentences on how many results of a run were accepted, and which cannot be accepted."""
    changed = found["change"].value_counts()
    changes = ", ".join(f"{changed[one]:,} {one}" for one in ("new", "worse", "moved", "better", "gone", "same") if one in changed)
    measured = [engine for engine in results.engines if (found["engine"] == engine).any()]
    listed = [f"Accepted for {counted(len(results.scenes), 'scene')} with {', '.join(measured)}: {changes or 'no results'}."]
    tally = counts(results)
    acceptable = int(comparable_results(results)["verdict"].isin(FAILURES).sum())
    unknown = tally.failed - acceptable
    if tally.failed and not known_failures:
        fail = counted(tally.failed, "check of this run fails", "checks of this run fail")
        those = f"the {acceptable:,} with comparable results" if unknown else "them"
        listed.append(f"{fail}, so dropspin check will fail too; --known-failures accepts {those} as known failures.")
    if unknown and known_failures:
        have = counted(unknown, "failing check has", "failing checks have")
        listed.append(f"{have} no comparable result and cannot be accepted.")
    if tally.broken:
        listed.append(f"{counted(tally.broken, 'engine run')} broke down; results accepted earlier for them stay in the baseline.")
    return listed


def annotations(found: Sequence[Failure]) -> list[str]:
    """The workflow commands by which a runner of GitHub shows failures; empty elsewhere."""
    if os.environ.get("GITHUB_ACTIONS") != "true":
        return []
    return [_annotation(one) for one in found[:MOST_ANNOTATIONS]]


def _annotation(failure: Failure) -> str:
    title = _escaped(f"{failure.scene} {failure.engine}", ":,")
    text = _escaped(f"{failure.sentence.removesuffix('.')}. Reproduce: {failure.reproduce}")
    return f"::error title={title}::{text}"


def _without_baseline(results: Results) -> Results:
    return replace(results, table=results.table[results.table["kind"] != "baseline"])


def _attributed(checked: Checked) -> list[str]:
    """For each engine, the causes to which its failing accepted results are attributed."""
    found = []
    for (engine, cause), count in checked.attributions.items():
        are = counted(count, "result is", "results are")
        found.append(f"{engine}: {are} worse, moved or gone. {cause.message[0].upper()}{cause.message[1:]}.")
    return found


def _escaped(text: str, more: str = "") -> str:
    """Text escaped for GitHub's workflow commands; % is escaped first."""
    for sign in f"%\r\n{more}":
        text = text.replace(sign, f"%{ord(sign):02X}")
    return text

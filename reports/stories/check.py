"""The output of `dropspin check` and `dropspin accept`: the outcome of the checks, and the results that were accepted."""

import shlex
from collections.abc import Sequence
from dataclasses import replace

import pandas as pd

from dropspin.comparisons.judging.verdicts import BREAKDOWNS, FAILURES
from dropspin.comparisons.regressions.changes import asked_for, broke_down, comparable_results, regressed
from dropspin.comparisons.regressions.checking import Checked
from dropspin.comparisons.results.provenance import versions_behind
from dropspin.comparisons.results.results import Results
from dropspin.reports.document import Document, Paragraph, Sentences, Table
from dropspin.reports.stories.failures import Failure, failure_parts
from dropspin.reports.stories.findings import counts, not_repeated, verdict_sentence
from dropspin.reports.stories.numbers import capitalized, failing
from dropspin.scenarios.text import counted

MOST_MISSING = 5
"""The most scenes with an engine that are listed as not covered."""
JUDGED = FAILURES | BREAKDOWNS | {"passed", "missing"}


def document(checked: Checked, failures: Sequence[Failure], run: str, baseline: str | None) -> Document:
    """The failures of each engine, and the outcome of the checks; a page also has the number of checks by verdict, and versions.

    Args:
        checked: The outcome of the checks.
        failures: The failures to list.
        run: The folder of the run, as it appears in printed commands.
        baseline: The file of the baseline; None without one.
    """
    results, listed = checked.results, list(failure_parts(checked.results, failures, baseline))
    *notes, verdict = sentences(checked, run, baseline)
    tallies = Table([_tally(results, engine) for engine in results.engines], on_terminal=False)
    versions = ", ".join(f"{name} {version}" for name, version in versions_behind(results.provenance).items())
    machine = Paragraph(f"{versions} on {results.provenance['cpu']}", on_terminal=False)
    scope = " only, without a baseline" if baseline is None else f", and the accepted results in {baseline}"
    checks = f"Checked: the expectations of the scenes{scope}."
    outcome = [Sentences([checks, *not_repeated(results), *notes]), Paragraph(verdict, on_page=False)]
    return Document(f"dropspin: {'✗' if listed else '✓'} {verdict}", [*listed, tallies, machine], outcome)


def _tally(results: Results, engine: str) -> dict[str, str]:
    """The number of checks of an engine by verdict, and the number of rows in which it broke down or is missing."""
    mine = results.table["engine"] == engine
    numbers = results.table.loc[mine, "verdict"].value_counts()
    verdicts = {verdict: str(numbers.get(verdict, 0)) for verdict in ("passed", "failed", "known", "limited")}
    return {"engine": engine, **verdicts, "broke down or missing": str(results.breakdowns[mine].sum())}


def sentences(checked: Checked, run: str, baseline: str | None) -> list[str]:
    """Sentences on the outcome of the checks, the verdict last; the arguments are those of `document`."""
    table = checked.results.table
    without_baseline = replace(checked.results, table=table[table["kind"] != "baseline"])
    known = int((without_baseline.table["basis"] == "accepted_failure").sum())
    is_judged = not known or without_baseline.table["verdict"].isin(JUDGED).any()
    verdict = verdict_sentence(without_baseline, counts(without_baseline)) if is_judged else ""
    if baseline is None:
        return [verdict]
    failed_rows = table[(table["kind"] == "baseline") & (table["verdict"] == "failed")]
    changes = checked.changes["change"].value_counts()
    notes = []
    for (engine, cause), count in checked.attributions.items():
        notes.append(f"{engine}: {counted(count, 'result is', 'results are')} worse, moved or gone. {capitalized(cause.message)}.")
    for change, words in (("better", "better than accepted"), ("new", "new and not yet accepted"), ("undefined", "undefined now")):
        if count := int(changes.get(change, 0)):
            notes.append(f"{counted(count, 'result is', 'results are')} {words}.")
    if len(checked.not_run):
        notes.append(f"{not_covered(checked)}.")
    if known:
        notes.append(f"{counted(known, 'known failure is', 'known failures are')} not counted as failed.")
    acceptable = (~(broke_down(failed_rows, checked.results) & (failed_rows["metric"] == ""))).any()
    if acceptable or {"better", "new"} & set(changes.index):
        command = shlex.join(["dropspin", "accept", run, "--baseline", baseline, "--reason"])
        notes.append(f'If the changes are intended: {command} "…"')
    return [*notes, _verdict(checked, failed_rows, verdict)]


def not_covered(checked: Checked) -> str:
    """The number of accepted results that a run does not cover, and of which scenes and engines they are."""
    are, results = counted(len(checked.not_run), "accepted result is", "accepted results are"), checked.results
    missing = []
    for (scene, engine), rows in checked.not_run.groupby(["scene", "engine"], sort=False):
        was_run = scene in results.scenes and engine in results.engines  # at other time steps
        missing.append(f"{scene} with {engine}" + (f" at {'; '.join(dict.fromkeys(rows['steps']))} s" if was_run else ""))
    more = [f"{len(missing) - MOST_MISSING:,} other pairs"] if len(missing) > MOST_MISSING + 1 else missing[MOST_MISSING:]
    return f"{are} not covered by this run: {', '.join(missing[:MOST_MISSING] + more)}"


def _verdict(checked: Checked, failed_rows: pd.DataFrame, verdict: str) -> str:
    """The last sentence: the verdict on the accepted results and on the other checks of the run."""
    failed = len(regressed(checked.changes))
    judged = int(checked.changes["change"].isin(["same", "better", "lower"]).sum()) + failed
    changed = failed_rows.loc[failed_rows["basis"] == "scene_changed", "scene"].nunique()
    scenes = f"{counted(changed, 'scene has', 'scenes have')} changed since results were accepted. " if changed else ""
    if failed or changed:
        those = f"{failing(failed, judged, 'accepted result')}." if judged else "No accepted result was compared."
        return f"{scenes}{those} {verdict}".rstrip()
    hold = "The accepted result holds" if judged == 1 else f"All {judged:,} accepted results hold"
    return f"{verdict} {hold}.".lstrip() if judged else verdict


def accepted_sentences(results: Results, accepted: pd.DataFrame, known_failures: bool, redefined: Sequence[str] = ()) -> list[str]:
    """Sentences on how many results of a run were accepted, also in scenes with another definition, and which cannot be accepted."""
    changed = accepted["change"].value_counts()
    order = ("new", "worse", "moved", "better", "lower", "gone", "undefined", "same")
    kinds = [f"{changed[kind]:,} {kind}" for kind in order if kind in changed]
    measured = ", ".join(engine for engine in results.engines if (accepted["engine"] == engine).any())
    notes = [f"Accepted for {counted(len(results.scenes), 'scene')} with {measured}: {', '.join(kinds) or 'no results'}."]
    if redefined:
        notes.append(f"The definition has changed of {', '.join(redefined)}: the results accepted before are replaced, not compared.")
    notes += not_repeated(results)
    removed = accepted.drop(asked_for(accepted, results).index).query("change in ['gone', 'undefined']")
    if len(removed):
        pairs = ", ".join(f"{scene} with {engine}" for scene, engine in removed[["scene", "engine"]].drop_duplicates().to_numpy())
        are = counted(len(removed), "accepted result is", "accepted results are")
        notes.append(f"{are} removed, because the scene has changed and this run does not cover them: {pairs}. Run and accept these too.")
    tally = counts(results)
    acceptable = int(comparable_results(results)["verdict"].isin(FAILURES).sum())
    unknown = tally.failed - acceptable
    if tally.failed and not known_failures:
        fail = counted(tally.failed, "check of this run fails", "checks of this run fail")
        those = f"the {acceptable:,} with comparable results" if unknown else "it" if tally.failed == 1 else "them"
        remedy = f"; --known-failures accepts {those} as known failures" if acceptable else ""
        notes.append(f"{fail}, so dropspin check will fail too{remedy}.")
    if unknown and known_failures:
        have = counted(unknown, "failing check has", "failing checks have")
        notes.append(f"{have} no comparable result and cannot be accepted.")
    if tally.broken:
        notes.append(f"{counted(tally.broken, 'engine run')} broke down; the results accepted for them before stay in the baseline.")
    return notes

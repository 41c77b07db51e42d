"""The output of `dropspin run`: the overview of a run, computed once for terminal, HTML and Markdown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from comparisons.results.results import Results, Status
from reports.views.failures import Failure, failures, reproduce_drawn
from reports.views.findings import (
    Counts,
    ProfileComparison,
    asymptotic_errors,
    counts,
    finding_sentences,
    profile_comparisons,
    verdict_sentence,
)


@dataclass(frozen=True)
class Overview:
    """The first part of a report.

    Attributes:
        verdict: The outcome of the checks in one sentence.
        findings: The main finding on each engine, and the command that draws the same random scenes again.
        counts: The number of checks with each verdict.
        statuses: The status of each engine in each scene, by scene and engine.
        profiles: Engines with default settings compared with the calibrated ones.
        failures: The failures, grouped.
    """

    verdict: str
    findings: Sequence[str]
    counts: Counts
    statuses: Mapping[str, Mapping[str, Status]]
    profiles: Sequence[ProfileComparison]
    failures: Sequence[Failure]


def overview(results: Results) -> Overview:
    """The overview of a run."""
    tally, profiles = counts(results), profile_comparisons(results)
    findings = finding_sentences(results, {cause: asymptotic_errors(results, cause) for cause in ("model", "setting")}, profiles)
    findings = [*findings, *reproduce_drawn(results)]
    return Overview(verdict_sentence(results, tally), findings, tally, results.statuses(), profiles, failures(results))

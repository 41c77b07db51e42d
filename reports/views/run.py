"""`dropspin run` in words: the overview of a run, computed once for terminal, HTML and Markdown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from comparisons.results.results import Results
from reports.views.failures import Failure, failures
from reports.views.findings import (
    Counts,
    ProfileComparison,
    asymptotic_errors,
    counts,
    finding_sentences,
    profile_comparisons,
    verdict_sentence,
    verdicts,
)

LASTING = {"model": "model error", "setting": "setting"}
"""By cause, the words for an error that does not vanish as dt → 0."""


@dataclass(frozen=True)
class Overview:
    """What a report begins with.

    Attributes:
        verdict: The outcome of the checks in one sentence.
        findings: The main finding about each engine.
        counts: The verdicts, counted.
        verdicts: By scene and engine: all verdicts, the worst first.
        chips: By scene and engine: the worst verdict, and the causes of errors that do not vanish as dt → 0.
        profiles: Engines with default settings compared with the calibrated ones.
        failures: What failed.
    """

    verdict: str
    findings: Sequence[str]
    counts: Counts
    verdicts: Mapping[tuple[str, str], Sequence[str]]
    chips: Mapping[str, Mapping[str, Sequence[str]]]
    profiles: Sequence[ProfileComparison]
    failures: Sequence[Failure]


def overview(results: Results) -> Overview:
    """The overview of a run."""
    tally, found, profiles = counts(results), verdicts(results), profile_comparisons(results)
    lasting = {cause: asymptotic_errors(results, cause) for cause in LASTING}
    chips = {
        scene: {
            engine: [
                found.get((scene, engine), ["missing"])[0],
                *(words for cause, words in LASTING.items() if scene in lasting[cause][engine]),
            ]
            for engine in results.engines
        }
        for scene in results.scenes
    }
    findings = finding_sentences(results, lasting, profiles)
    return Overview(verdict_sentence(results, tally), findings, tally, found, chips, profiles, failures(results))

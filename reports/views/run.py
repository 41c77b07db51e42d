"""`dropspin run` in words: the overview at the head of a report."""

from typing import Any

from comparisons.results.results import Results
from reports.views.failures import failures
from reports.views.findings import asymptotic_errors, finding_sentences, verdict_sentence, verdicts

LASTING = {"model": "model error", "setting": "setting"}
"""By cause, the words for an error that does not vanish as dt → 0."""


def overview(results: Results) -> dict[str, Any]:
    """The overview: verdict, findings, matrix of scenes and engines, failures, provenance."""
    return {
        "verdict": verdict_sentence(results),
        "findings": finding_sentences(results),
        "engines": results.engines,
        "chips": chips(results),
        "failures": failures(results),
        "provenance": results.provenance,
    }


def chips(results: Results) -> dict[str, dict[str, list[str]]]:
    """By scene and engine: the worst verdict, and the causes of errors that do not vanish as dt → 0."""
    found, lasting = verdicts(results), {words: asymptotic_errors(results, cause) for cause, words in LASTING.items()}
    return {
        scene: {
            engine: [found.get((scene, engine), ["missing"])[0], *(words for words, where in lasting.items() if scene in where[engine])]
            for engine in results.engines
        }
        for scene in results.scenes
    }

"""`dropspin run` in words: what the report begins with, and what a scene models."""

from typing import Any

from comparisons.results.results import Results
from reports.views.failures import failures
from reports.views.findings import asymptotic_errors, finding_sentences, verdict_sentence, verdicts
from scenarios import Scenario

LASTING = {"model": "model error", "setting": "setting"}
"""Why an error does not vanish as dt → 0, and the words for it."""


def overview(results: Results) -> dict[str, Any]:
    """What the report begins with: verdict, findings, matrix of scenes and engines, failures."""
    return {
        "verdict": verdict_sentence(results),
        "findings": finding_sentences(results),
        "engines": results.engines,
        "chips": chips(results),
        "failures": failures(results),
        "provenance": results.provenance,
    }


def chips(results: Results) -> dict[str, dict[str, list[str]]]:
    """By scene and engine: the verdict that counts, and why an error stays, if one does."""
    found, stuck = verdicts(results), {words: asymptotic_errors(results, cause) for cause, words in LASTING.items()}
    return {
        scene: {
            engine: [found.get((scene, engine), ["missing"])[0], *(words for words, where in stuck.items() if scene in where[engine])]
            for engine in results.engines
        }
        for scene in results.scenes
    }


def modelled(scene: Scenario) -> list[str]:
    """What of a scene is simulated, in words."""
    parts = [f"a {scene.body.shape} of {scene.body.mass:g} kg" if scene.body.shape != "vertices" else "a set of vertices"]
    if scene.gravity is not None:
        parts.append("gravity")
    if scene.floor is not None:
        friction = scene.floor.friction
        grip = {"none": "no friction", "infinite": "infinite friction"}.get(str(friction), f"friction {friction}")
        parts.append(f"a floor of restitution {scene.floor.restitution:g} and {grip}")
    if scene.damping is not None:
        parts.append(f"damping of {scene.damping.linear:g} and {scene.damping.angular:g} per second")
    if scene.ensemble is not None:
        parts.append(f"{scene.ensemble.size} starts drawn around the scene's own")
    return parts


def left_out(scene: Scenario) -> list[str]:
    """What a scene does not model, so that no engine pays for it."""
    return [part for part in ("gravity", "floor", "damping") if getattr(scene, part) is None]

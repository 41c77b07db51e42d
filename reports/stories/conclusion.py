"""The conclusion of a run: for each question (an error within a tolerance) which engine to use, at which time steps, and where not."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.results.conclusion import CONDITIONS, ENOUGH, WITHIN, Answer, conclude
from dropspin.comparisons.results.results import UNDECIDED, Results
from dropspin.reports.plots.colours import in_sentence
from dropspin.reports.stories.matrix import step_times
from dropspin.reports.stories.numbers import MOST_NAMED, duration, grouped, in_ms, named, quantity, short
from dropspin.scenarios.text import counted

MOST_QUESTIONS = 3


class Point(NamedTuple):
    """A sentence of a conclusion: its beginning, and what it says of each engine, which is a line of its own on a page."""

    text: str
    parts: Sequence[str] = ()

    def __str__(self) -> str:
        return f"{self.text} {'; '.join(self.parts)}." if self.parts else self.text


def conclusion(results: Results) -> list[Point]:
    """At most five sentences: one for each of the first questions, the cost, and what is undecided.

    Where too few scenes test a question to recommend an engine for it, the sentences state what these scenes say, and what to run.
    """
    within = _within(results)
    questions = grouped(conclude(results, within), lambda answer: answer.metric)
    tested = [answers for answers in questions.values() if answers[0].scenes >= ENOUGH]
    if tested:
        recommended = [_recommendation(answers, within) for answers in tested[:MOST_QUESTIONS]]
        return [*recommended, *map(Point, [*_cost(results), *_undecided(results)])]
    if not questions and results.recorded:
        return []
    if not questions and results.breakdowns.any():
        return [Point("No recommendation: no engine has an error to judge.")]
    none = f"No recommendation: it takes {ENOUGH} scenes with the same kind of error. dropspin run, without names, runs the core catalogue."
    return [Point(text) for text in [*(_statement(answers, within) for answers in list(questions.values())[:MOST_QUESTIONS]), none]]


def conditions(results: Results) -> dict[str, list[str]]:
    """For each property by which the conclusion excepts scenes, such as Coulomb friction, the scenes that have it."""
    within = _within(results)
    excepted = dict.fromkeys(answer.condition for answer in conclude(results, within) if answer.condition and answer.is_recommended)
    return {name: [scene for scene, model in results.scenes.items() if CONDITIONS[name](model)] for name in excepted}


def _within(results: Results) -> float:
    """The largest error, relative to its scale, up to which an engine is recommended."""
    return float(results.provenance["asked"].get("within") or WITHIN)


def _recommendation(answers: Sequence[Answer], within: float) -> Point:
    """Which engines to use for a question that enough scenes test, the best first, and which not."""
    ordered = sorted(answers, key=lambda answer: (not answer.is_recommended, -len(answer.within), math.isnan(answer.cost), answer.cost))
    question = f"For {_tolerance(answers[0].metric, within)}"
    if ordered[0].is_recommended:
        return Point(f"{question} use", [_use(answer) if answer.is_recommended else f"not {_count(answer, within)}" for answer in ordered])
    return Point(f"{question} no engine is recommended:", [_count(answer, within) for answer in ordered])


def _use(answer: Answer) -> str:
    """At which time steps an engine is recommended, and in which scenes not."""
    return f"{in_sentence(answer.engine)} {_steps(answer)}{_exceptions(answer)}{_absent(answer)}"


def _count(answer: Answer, within: float) -> str:
    """In how many of the scenes in which it has a result an engine that is not recommended is within the tolerance."""
    tested = _tested(answer)
    count = f"within {_limit(answer.metric, within)} in {len(answer.within)} of {counted(tested, 'scene')}" if tested else ""
    return f"{in_sentence(answer.engine)}{_in_brackets(count, _size(answer, names_worst=True))}{_absent(answer)}"


def _statement(answers: Sequence[Answer], within: float) -> str:
    """What a few scenes say about a question; engines of which they say the same are named together."""
    said: dict[str, list[str]] = {}
    for answer in answers:
        clauses = [
            (f"{{}} {_steps(answer)}", answer.within),
            (f"not {{}}{_in_brackets(_size(answer))}", answer.beyond),
            ("undecided for {}", answer.undecided),
        ]
        for clause, scenes in clauses:
            if scenes:
                where = f" in {named(scenes, 'scene')}" if answer.scenes > 1 else ""
                said.setdefault(clause + where, []).append(in_sentence(answer.engine))
    text = _tolerance(answers[0].metric, within)
    clauses_of = (clause.format(named(engines, "engine", len(engines))) for clause, engines in said.items())
    return f"{text[0].upper()}{text[1:]}: {'; '.join(clauses_of)}."


def _tolerance(metric: str, within: float) -> str:
    """A quantity with the largest error that is asked for."""
    return f"{quantity(metric)} within {_limit(metric, within)}{' of the lengths of the scene' if METRICS[metric].unit == 'm' else ''}"


def _limit(metric: str, within: float) -> str:
    """The largest error that is asked for: an angle, or percent."""
    return f"{within:g} rad" if METRICS[metric].unit == "rad" else f"{100 * within:g} %"


def _size(answer: Answer, *, names_worst: bool = False) -> str:
    """How large the errors beyond the tolerance are; empty if there are none, or if the engine broke down in one of these scenes.

    Args:
        answer: The answer.
        names_worst: Whether the scene with the largest error is named, because the sentence does not name the scenes.
    """
    if math.isnan(answer.largest):
        return ""
    unit = METRICS[answer.metric].unit
    size = f"{short(answer.largest)} {unit}" if unit == "rad" else f"{short(100 * answer.largest)} %"
    return f"{'up to ' if len(answer.beyond) > 1 else ''}{size}{f' in {answer.worst}' if names_worst else ''}"


def _steps(answer: Answer) -> str:
    """The time steps at which an engine is within the tolerance."""
    if math.isnan(answer.dt):
        return "at the finest step of each scene"
    return f"at {in_ms(answer.dt)}{' or less' if answer.dt > answer.steps[0] else ''}"


def _exceptions(answer: Answer) -> str:
    """The scenes in which an engine is not within the tolerance, or not known to be."""
    count, rest = f"{len(answer.beyond) - len(answer.named)} scenes", answer.named
    covered = _in_brackets(count, "" if rest else _size(answer))
    parts = [f"with {answer.condition}{covered}"] if answer.condition else []
    parts += [f"in {named(rest, 'scene')}{_in_brackets(_size(answer, names_worst=len(rest) > MOST_NAMED))}"] if rest else []
    except_ = f", except {' and '.join(parts)}" if parts else ""
    return f"{except_}, undecided in {named(answer.undecided, 'scene')}" if answer.undecided else except_


def _in_brackets(*texts: str) -> str:
    """The texts that are not empty, in brackets after a space."""
    return f" ({', '.join(filter(None, texts))})" if any(texts) else ""


def _tested(answer: Answer) -> int:
    """The number of scenes in which an engine has a result."""
    return len(answer.within) + len(answer.beyond) + len(answer.undecided)


def _absent(answer: Answer) -> str:
    """The number of scenes in which an engine has no result."""
    count = answer.scenes - _tested(answer)
    if not count:
        return ""
    return f", {counted(count, 'scene')} declined" if count == answer.declined else f", no result in {counted(count, 'scene')}"


def _cost(results: Results) -> list[str]:
    """What a second of motion costs with each engine at the finest time step, the cheapest first; none if no engine was timed."""
    dt = results.table["dt"].min()
    times = {engine: time / dt for engine, time in step_times(results).items()}
    costs = [f"{in_sentence(engine)} {duration(float(f'{times[engine]:.2g}'))}" for engine in sorted(times, key=times.__getitem__)]
    return [f"1 s of motion at dt = {in_ms(dt)} takes {', '.join(costs)}."] if costs else []


def _undecided(results: Results) -> list[str]:
    """A sentence on the scenes in which an engine has the mark ~; none if there are none."""
    statuses = results.statuses().items()
    marked = {engine: [scene for scene, by_engine in statuses if by_engine[engine].reason == UNDECIDED] for engine in results.engines}
    parts = [f"{in_sentence(engine)} in {named(scenes, 'scene')}" for engine, scenes in marked.items() if scenes]
    return [f"Trend as dt → 0 undecided (~): {'; '.join(parts)}."] if parts else []

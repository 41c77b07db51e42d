"""The failures of a run, with scene, engine, result and size, and the commands that reproduce them."""

import math
import shlex
from collections.abc import Iterator, Sequence
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple

from dropspin.comparisons.judging.convergence import STUDIES
from dropspin.comparisons.judging.verdicts import FAILURES
from dropspin.comparisons.measuring.symmetries import kind_of
from dropspin.comparisons.regressions.causes import WrongParameter, causes
from dropspin.comparisons.results.results import MOST_NAMES, Results
from dropspin.comparisons.running.ablation import ALL_SETTINGS
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.reports.document import Paragraph, Part, Sentences
from dropspin.reports.stories.numbers import Row, bound, explained_by, formatted, grouped, in_ms, listed, step, subject, word
from dropspin.scenarios.text import counted, rounded

MOST_ON_PAGE, MOST_ON_TERMINAL = 24, 6
"""Largest number of sentences on the failures of one engine, on a page and on a terminal; JUnit, JSON and the report have all failures."""


class Failure(NamedTuple):
    """A failure: the failed rows of one metric of one engine in one scene, described by the first of these rows.

    Attributes:
        scene: Name of the scene.
        engine: Label of the engine.
        where: The time step, in words.
        what: The failed result in words, with value, bound and reason.
        result: The name of the failed result, such as `order of orientation error`; empty for a breakdown.
        others: Number of other rows, at other time steps, that fail in the same way.
        reproduce: The command, or the call, that reproduces it.
        broke_down: Whether the engine crashed, hung, diverged, or is missing.
        accepted: Whether it is an accepted result that fails.
        of_symmetry: Whether it is a symmetry or a repeated run that fails.
    """

    scene: str
    engine: str
    where: str
    what: str
    result: str
    others: int
    reproduce: str
    broke_down: bool
    accepted: bool
    of_symmetry: bool

    @property
    def sentence(self) -> str:
        """The failure in one line, without the command."""
        others = f" (and {self.others} other time {'step' if self.others == 1 else 'steps'})" if self.others else ""
        return f"{self.scene} · {self.engine}{self.where}: {self.what}{others}"


def failures(results: Results, baseline: str | None = None) -> list[Failure]:
    """The failures of a run.

    The order is: breakdowns, deviations from accepted results (the largest first), asymptotic errors, others.

    Args:
        results: The run, with the rows of a check if there was one.
        baseline: The baseline file it was compared with, for the commands.
    """
    rows = results.table[results.breakdowns | results.table["verdict"].isin(FAILURES)]
    of_kind = rows["kind"].map({"baseline": 0.0, "asymptotic_error": 1.0}).astype(float).fillna(2.0)
    gone = (rows["value"].isna() & rows["metric"].ne("")).astype(float)
    urgency = (of_kind + 0.5 * gone).where(rows["verdict"].isin(FAILURES), -1.0)
    accepted = rows["truth"].where(rows["kind"] == "baseline", "")
    ordered = rows.assign(urgency=urgency, accepted=accepted).sort_values("urgency", kind="stable").to_dict("records")
    alike = grouped(ordered, itemgetter("scene", "engine", "metric", "verdict", "kind", "accepted"))
    return [_failure(results, group, baseline) for group in alike.values()]


def _failure(results: Results, group: Sequence[Row], baseline: str | None) -> Failure:
    row = group[0]
    where = "" if math.isnan(row["dt"]) and not row["metric"] else f" · {step(row['dt'])}{'' if math.isnan(row['dt']) else ' s'}"
    return Failure(
        scene=row["scene"],
        engine=row["engine"],
        where=where,
        what=what_fails(row),
        result=subject(row["metric"], row["kind"], row["truth"]) if row["metric"] else "",
        others=len(group) - 1,
        reproduce=reproduce(results, row, baseline),
        broke_down=row["verdict"] not in FAILURES,
        accepted=row["kind"] == "baseline",
        of_symmetry=kind_of(row["metric"]) is not None,
    )


def failure_parts(results: Results, failures: Sequence[Failure], baseline: str | None = None) -> Iterator[Part]:
    """For each engine: what explains its asymptotic errors, a sentence for each cause of failures, and one command that reproduces them.

    Failures of an engine in one scene are assumed to have one cause, and so are breakdowns with the same message in several scenes.
    """
    broken = {(failure.scene, failure.engine) for failure in failures if failure.broke_down}
    # Accepted results of an engine that broke down are gone because it broke down.
    shown = [failure for failure in failures if failure.result or not failure.accepted or (failure.scene, failure.engine) not in broken]
    for engine, of_engine in grouped(shown, attrgetter("engine")).items():
        by_cause = grouped(of_engine, lambda failure: (failure.broke_down, failure.what if failure.broke_down else failure.scene))
        explained = [*_consistent_with(results, engine), *settings_that_explain(results, engine)]
        sentences = [f"✗ {_of_one_cause(alike)}" for alike in by_cause.values()]
        for most, on_page in ((MOST_ON_PAGE, True), (MOST_ON_TERMINAL, False)):
            more = len(sentences) - most
            others = [f"✗ {engine} has {counted(more, 'more failure')}."] if more > 0 else []
            yield Sentences([*explained, *sentences[:most], *others], style="red", on_page=on_page, on_terminal=not on_page)
        scenes = list(dict.fromkeys(failure.scene for alike in by_cause.values() for failure in alike))
        of_baseline = baseline if any(failure.accepted for failure in of_engine) else None
        checks = _checks(of_baseline, symmetries=any(failure.of_symmetry for failure in of_engine))
        yield Paragraph("Reproduce:", reproduce_scenes(results, scenes, engine, more=checks))


def _consistent_with(results: Results, engine: str) -> list[str]:
    """A sentence on wrong parameters and faults, each of which alone explains the asymptotic errors of an engine; empty without them."""
    parameters, faults, unexamined = causes(results, engine)

    def where(cause: str) -> str:
        left = unexamined[cause]
        return f" (not examined in {listed(left) if len(left) <= MOST_NAMES else counted(len(left), 'failing scene')})" if left else ""

    wrong = " or ".join(dict.fromkeys(f"{_described(one)}{where(one.parameter.name)}" for one in parameters))
    listed_causes = "; or ".join(filter(None, [wrong, *(f"{fault.message}{where(fault.message)}" for fault in faults)]))
    return [f"Possible cause of the asymptotic errors of {engine}: {listed_causes}."] if listed_causes else []


NONE_ALONE = "resetting one or two of them does not take away 90 % of this"
OTHER_SIGN = 1.1
"""Share of an error, taken away, from which an error of the other sign is left."""


def settings_that_explain(results: Results, engine: str) -> Iterator[str]:
    """A sentence for each error that changed settings of an engine explain; scenes with the same settings share a sentence."""
    mine = results.table[(results.table["kind"] == "setting") & (results.table["engine"] == engine)].to_dict("records")
    by_scene = grouped(mine, itemgetter("scene", "metric", "dt", "basis"))
    for ((scene, metric, dt, basis), rows), *others in grouped(by_scene.items(), _common).values():
        also = f"; the same settings explain it in {listed([where for (where, *_), _ in others])}" if others else ""
        change = "change of the " if basis == "since_accepted" else ""
        found, error = {row["truth"]: row["value"] for row in rows}, f"of the {change}{subject(metric, 'truth', '')} at {in_ms(dt)}"
        removed, of_this = found.pop(ALL_SETTINGS, None), ""
        if removed is not None:
            sign = ", so that an error of the other sign is left" if removed > OTHER_SIGN else ""
            of_this, error = f"calibrated settings take away {rounded(100.0 * removed, 3)} % {error}{sign}; ", "of this"
        yield f"{scene}: {of_this}{explained_by(found, error) if found else NONE_ALONE}{also}."


def _common(of_scene: tuple[Any, list[Any]]) -> tuple[str, ...]:
    """What scenes have in common that share a sentence; what calibrated settings take away differs from scene to scene."""
    (scene, metric, _, basis), rows = of_scene
    names = [row["truth"] for row in rows]
    return metric, basis, *names, scene if ALL_SETTINGS in names else ""


def _described(wrong: WrongParameter) -> str:
    name, unit, _ = wrong.parameter
    size = f"{rounded(100.0 * abs(wrong.size), 2)} %" if unit == "1" else f"{rounded(abs(wrong.size), 2)} {unit}"
    if not wrong.signed or unit == "rad":
        return f"{name} wrong by {size}"
    return f"{name} {size} too {'high' if wrong.size > 0.0 else 'low'}"


def _of_one_cause(failures: Sequence[Failure]) -> str:
    """A sentence on failures of one cause: the first failure, and the number of the others."""
    first, *others = failures
    more = ""
    if others and first.broke_down:
        more = f"; the same in {listed(list(dict.fromkeys(failure.scene for failure in others)))}"
    elif others:
        results = list(dict.fromkeys(failure.result for failure in others if failure.result not in ("", first.result)))
        count = sum(1 + failure.others for failure in others)
        fail = counted(count, "other result of this scene fails", "other results of this scene fail")
        more = f"; {fail}" + (f" ({listed(results)})" if results else "")
    return f"{first.sentence.rstrip('.')}{more}."


def what_fails(row: Row) -> str:
    """A failed row in words: value, bound or interval, and reason."""
    if not row["metric"]:
        return str(row["reason"]) if row["verdict"] in FAILURES else f"{word(row['verdict'])}. {row['reason']}"
    name = subject(row["metric"], row["kind"], row["truth"])
    if row["kind"] == "baseline":  # with more digits than elsewhere: tolerances are small
        return f"{name} is {row['value']:.6g}, {row['reason']}"
    limits = bound(row["lower"], row["upper"])
    expected = f", {'95 % interval' if row['kind'] in STUDIES else 'expected'} {limits}" if limits else ""
    value = "undefined" if math.isnan(row["value"]) else formatted(row["value"])
    return f"{name} is {value}{expected}{':' if row['kind'] in STUDIES else ';'} {row['reason']}"


def reproduce(results: Results, row: Row, baseline: str | None = None) -> str:
    """The command that measures a row again, or the Python call if the scene or the engine was given as an object."""
    dts = None if math.isnan(row["dt"]) or row["kind"] in STUDIES else [row["dt"]]
    more = _checks(baseline if row["kind"] == "baseline" else None, symmetries=kind_of(row["metric"]) is not None)
    return reproduce_scenes(results, [row["scene"]], row["engine"], dts, more)


def _checks(baseline: str | None, *, symmetries: bool) -> list[str]:
    """The options of a run that compares with a baseline, or tests symmetries."""
    return ["--symmetries"] * symmetries + ([] if baseline is None else ["--baseline", baseline])


def reproduce_scenes(
    results: Results, names: Sequence[str], label: str, dts: Sequence[float] | None = None, more: Sequence[str] = ()
) -> str:
    """The command that runs scenes with one engine again, or the Python call if a scene or the engine was given as an object.

    Args:
        results: The run.
        names: Names of the scenes.
        label: Label of the engine.
        dts: Time steps [s]; None for all time steps of the run.
        more: More options of the command; a Python call has none.
    """
    asked = results.provenance["asked"]
    scenes, steps = [results.scenes[name] for name in names], sorted(asked["dts"] if dts is None else dts, reverse=True)
    engine = results.provenance["names"].get(label)  # my_module:MyEngine has a name of its own in results
    if engine is None or not all(scene.origin for scene in scenes):
        named = [repr(scene.origin) if scene.origin else f"<scene {scene.name!r}>" for scene in scenes]
        named_scenes = named[0] if len(named) == 1 else f"[{', '.join(named)}]"
        named_engine = f"<engine {label!r}>" if engine is None else repr(engine)
        return f"dropspin.run({named_scenes}, {named_engine}, dt={[float(dt) for dt in steps]}{', quick=True' * asked.get('quick', False)})"
    return _command(results, [scene.origin for scene in scenes], [engine], steps, more)


def reproduce_drawn(results: Results) -> list[str]:
    """A sentence with the seed of a run's random scenes and the command that runs them again; empty if the run has no random scenes."""
    asked = results.provenance["asked"]
    if "draw" not in asked:
        return []
    named = [results.scenes[name].origin for name in asked["scenes"][: -asked["draw"]]]
    scenes = [*named, "--draw", str(asked["draw"]), "--seed", str(asked["seed"])]
    engines = [results.provenance["names"][label] for label in results.engines]
    command = _command(results, scenes, engines, sorted(asked["dts"], reverse=True))
    return [f"{counted(asked['draw'], 'scene was', 'scenes were')} drawn with seed {asked['seed']}. Reproduce: {command}"]


def _command(results: Results, scenes: Sequence[str], engines: Sequence[str], dts: Sequence[float], more: Sequence[str] = ()) -> str:
    """The command that runs scenes again at time steps [s], with `--quick` and `--time-limit` if the run had them."""
    asked = results.provenance["asked"]
    words = [word for engine in engines for word in ("-e", engine)] + [word for dt in dts for word in ("--dt", repr(float(dt)))]
    words += ["--quick"] * asked.get("quick", False)
    limit = asked["time_limit"]
    words += [] if limit == ResourceLimits().processor_time else ["--time-limit", f"{limit:g}"]
    return shlex.join(["dropspin", "run", *scenes, *words, *more, "-o", "out/again"])

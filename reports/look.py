"""What `list`, `show` and `doctor` have to say: rows of words, for a table or for JSON."""

import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from comparisons import ENSEMBLE_METRICS, METRICS, EngineMissing, engine, engine_names, simulate
from comparisons.building import assert_built_as_meant
from comparisons.calibration import Calibration, Measured
from comparisons.isolation import Cells, Failed, Limits
from comparisons.metrics import metrics_for
from comparisons.provenance import processor, versions
from comparisons.run import prepared
from comparisons.simulating import Contestant, assert_step_fits, contestant_named
from comparisons.verdicts import assert_expectations_can_be_judged
from reports.html import left_out, modelled
from reports.numbers import bound
from scenarios import DropspinError, Scenario, load, names, truth_for

Rows = list[dict[str, str]]


def scene_rows() -> Rows:
    """The catalogue."""
    rows = []
    for name in names():
        scene = load(name)
        truth = truth_for(scene)
        rows.append({"scene": name, "truth": truth.name if truth else "", "tags": ", ".join(scene.tags), "summary": scene.summary})
    return rows


def plan(scenes: Sequence[Scenario], engines: Sequence[str], dts: Sequence[float]) -> dict[str, Any]:
    """What a run would be of, as JSON has it; `from` is what was asked for, which a run of one scene or engine can be asked for again.

    Raises:
        DropspinError: It could not be run.
    """
    contestants, truths = prepared(scenes, engines, dts)
    metrics = [
        [metric.name for metric in metrics_for(scene, truth)] + (list(ENSEMBLE_METRICS) if scene.ensemble else [])
        for scene, truth in zip(scenes, truths, strict=True)
    ]
    return {
        "scenes": [{"scene": one.name, "from": one.origin, "metrics": names} for one, names in zip(scenes, metrics, strict=True)],
        "engines": [{"engine": one.label, "from": name, "missing": one.missing} for one, name in zip(contestants, engines, strict=True)],
        "dts": list(dts),
    }


def plan_rows(found: dict[str, Any]) -> Rows:
    """The same, for a table."""
    missing = {one["engine"]: f" ({one['missing']})" if one["missing"] else "" for one in found["engines"]}
    rows = [{"what": "engines", "is": ", ".join(f"{name}{why}" for name, why in missing.items())}]
    rows.append({"what": "steps", "is": f"{', '.join(f'{dt:g}' for dt in found['dts'])} s"})
    return rows + [{"what": one["scene"], "is": ", ".join(one["metrics"])} for one in found["scenes"]]


def engine_rows() -> Rows:
    """The engines that can be named."""
    rows = []
    for name in engine_names():
        try:
            found = engine(name)
        except DropspinError as error:
            rows.append({"engine": name, "options": "", "summary": str(error)})
            continue
        choices = [f"{key} = {' | '.join(values)}" for key, values in found.choices.items()]
        numbers = [f"{key} = {allowed.least:g} … {allowed.most:g}" for key, allowed in found.numbers.items()]
        options = "; ".join(choices + numbers)
        rows.append({"engine": name, "options": options, "summary": (type(found).__doc__ or "").strip().splitlines()[0]})
    return rows


def metric_rows() -> Rows:
    """The metrics."""
    of_one = [
        {"metric": metric.name, "unit": metric.unit, "needs": metric.needs, "definition": metric.definition} for metric in METRICS.values()
    ]
    of_many = [
        {"metric": name, "unit": metric.unit, "needs": "an ensemble", "definition": f"Mean. {metric.definition}"}
        for name, metric in ENSEMBLE_METRICS.items()
    ]
    return of_one + of_many


def description(scene: Scenario) -> Rows:
    """A scene: what is modelled, its truth, what it expects."""
    truth = truth_for(scene)
    assert_expectations_can_be_judged(scene, truth, [])
    start = scene.start
    facts = {
        "scene": scene.name,
        "summary": scene.summary,
        "source": scene.source,
        "duration": f"{scene.duration:g} s",
        "modelled": ", ".join(modelled(scene)),
        "left out": ", ".join(left_out(scene)) or "nothing",
        "inertia": f"{scene.body.inertia_tensor.tolist()} kg m²",
        "start": f"x = {list(start.position)} m, q = {list(start.orientation)}",
        "start rates": f"v = {list(start.velocity)} m/s, ω = {list(start.angular_velocity)} rad/s",
        "truth": truth.statement if truth else "none known",
    }
    if truth and truth.events:
        facts["impacts"] = f"{len(truth.events)}, the first at {truth.events[0].time:.6f} s"
    for expectation in scene.expect:
        below, within, above = expectation.below, expectation.within, expectation.above
        limits = (-below, below) if below else within or (above, float("nan"))
        steps = ", ".join(f"{dt:g}" for dt in expectation.dt or ())
        who = " at ".join(filter(None, [expectation.engine or "any engine", f"{steps} s" if steps else ""]))
        facts[f"expect {expectation.metric} ({who})"] = f"{bound(*limits)}: {expectation.reason}"
    return [{"what": key, "is": value} for key, value in facts.items() if value]


def built_rows(scene: Scenario, engine_name: str, dt: float) -> Rows:
    """What an engine builds of a scene, read back, with its settings."""
    assert_step_fits(scene, dt)
    chosen = engine(engine_name)
    refusal = chosen.declines(scene)
    if refusal is not None:
        return [{"what": chosen.label, "is": f"declines {scene.name}: {refusal}"}]
    with chosen.prepare(scene, dt) as simulation:
        assert_built_as_meant(chosen, scene, simulation)
        built = simulation.as_built()
        rows = [
            {"what": "engine", "is": chosen.label, "why": ""},
            {"what": "staggered", "is": str(simulation.staggered), "why": "velocity lags position by half a step" * simulation.staggered},
        ]
        if built is not None:
            rows += [
                {"what": "mass", "is": f"{built.mass!r} kg", "why": "read back"},
                {"what": "inertia", "is": f"{built.inertia.tolist()} kg m²", "why": "read back"},
                {"what": "gravity", "is": f"{built.gravity.tolist()} m/s²", "why": "read back"},
            ]
        reasons = {} if simulation.settings.get("profile") == "default" else chosen.reasons
        settings = simulation.settings.items()
        return rows + [{"what": key, "is": str(value), "why": reasons.get(key, "")} for key, value in settings]


def friction(text: str) -> str | float:
    """A floor's friction as it is written on the command line.

    Raises:
        DropspinError: It is none.
    """
    if text in ("none", "infinite"):
        return text
    try:
        return float(text)
    except ValueError:
        raise DropspinError(f"friction: got {text!r}; it is none, infinite or a number.") from None


def measured_rows(found: Calibration) -> Rows:
    """What a calibrated engine was measured to do."""
    return [{"measured": one.name, "value": _with_unit(one), "how": one.how} for one in found.measured]


def _with_unit(one: Measured) -> str:
    if math.isnan(one.value):
        return "–"
    return f"{one.value:.4g}" if one.unit == "1" else f"{one.value:.4g} {one.unit}"


def setting_rows(found: Calibration) -> Rows:
    """What to set."""
    return [{"set": name, "to": str(value), "why": found.reasons.get(name, "")} for name, value in found.settings.items()]


def calibration(found: Calibration) -> dict[str, Any]:
    """All of a calibration, as JSON has it."""
    return {
        "engine": found.engine,
        "measured": [asdict(one) | {"value": None if math.isnan(one.value) else one.value} for one in found.measured],
        "settings": dict(found.settings),
        "programs": dict(found.programs),
    }


def doctor_rows(engines: Sequence[str]) -> Rows:
    """Versions, processor, and whether each engine steps."""
    rows = [{"what": package, "found": found or "not installed"} for package, found in versions().items()]
    rows += [{"what": "python", "found": sys.version.split()[0]}, {"what": "processor", "found": processor()}]
    with Cells(Limits(processor_time=60.0)) as cells:
        rows += [{"what": f"engine {name}", "found": _health(name, cells)} for name in engines]
    return rows


def _health(name: str, cells: Cells) -> str:
    """Whether an engine steps, tried in a process of its own."""
    try:
        return cells.call(contestant_named(engine(name)), _fall)
    except EngineMissing as error:
        return f"missing: {error}"
    except (DropspinError, Failed) as error:
        return f"broken: {error}"


def _fall(contestant: Contestant) -> str:
    assert contestant.engine is not None
    motion = simulate(load("fall-spin"), contestant.engine, 4e-3)
    return f"works: box at {motion.position[-1, 1]:.4f} m after {motion.t[-1]:g} s"

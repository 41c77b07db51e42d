"""The output of `dropspin show`: a scene, or the model that an engine builds of the scene."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dropspin.comparisons.engines.base import EngineBroken
from dropspin.comparisons.engines.settings import spelled
from dropspin.comparisons.judging.expectations import verify_expectations
from dropspin.reports.document import Rows
from dropspin.reports.stories.numbers import bound
from dropspin.reports.stories.scene import left_out, modelled
from dropspin.scenarios import Scenario, Truth, reference_for
from dropspin.scenarios.model import Expectation
from dropspin.scenarios.problems import identifier
from dropspin.scenarios.state import VELOCITY
from dropspin.scenarios.truths import Law, other_laws

if TYPE_CHECKING:
    from dropspin.comparisons.engines.base import Engine
    from dropspin.comparisons.running.arguments import EngineEntry


def scene_rows(scene: Scenario) -> Rows:
    """The description of a scene: what it models, its exact solution and its expectations."""
    truth = reference_for(scene)
    verify_expectations(scene, truth, [])
    start = scene.start
    facts = {
        "scene": scene.name,
        "problem": identifier(scene),
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
    impacts = [event for event in truth.events if (event.before != event.after).any()] if truth else []  # none of a body at rest
    if impacts:
        facts["impacts"] = f"{len(impacts)}, the first at {impacts[0].time:.6f} s"
    if truth and truth.is_exact and not truth.covers_all(scene.duration):
        facts["valid until"] = f"{truth.horizon:.6f} s: {truth.ends}"
    if truth and truth.is_exact and (others := other_laws(scene)):
        facts["other laws"] = _other_laws(truth, others)
    for expectation in scene.expect:
        facts[f"expect {expectation.metric} ({_applies_to(expectation)})"] = f"{_allowed(expectation)}: {expectation.reason}"
    return [{"what": key, "is": value} for key, value in facts.items() if value]


def _other_laws(truth: Truth, others: Mapping[Law, Truth]) -> str:
    """The differences of the velocity after the first impact under the other laws of impacts with friction."""
    after = truth.events[0].after[VELOCITY]
    changes = [f"{law} {np.linalg.norm(other.events[0].after[VELOCITY] - after):.2g} m/s" for law, other in others.items() if other.events]
    return (
        f"velocity after the first impact differs by: {', '.join(changes)}; the laws are other models, so these differences are not errors"
    )


def _applies_to(expectation: Expectation) -> str:
    """The engine and the time steps to which an expectation applies."""
    steps = ", ".join(f"{dt:g}" for dt in expectation.dt or ())
    return " at ".join(filter(None, [expectation.engine or "any engine", f"{steps} s" if steps else ""]))


def _allowed(expectation: Expectation) -> str:
    below, within, above = expectation.below, expectation.within, expectation.above
    limits = (-below, below) if below else within or (above, float("nan"))
    return bound(*limits)


def built_rows(scene: Scenario, engine_name: str, dt: float) -> Rows:
    """The model that an engine builds of a scene, as read back from the engine, with its settings.

    Raises:
        DropspinError: The engine cannot run, or breaks down while it builds the scene.
    """
    from dropspin.comparisons.running.arguments import verify_time_step
    from dropspin.comparisons.running.driving import Breakdown
    from dropspin.comparisons.running.engine_entries import present_entry
    from dropspin.comparisons.running.process_limits import ONE_MINUTE
    from dropspin.comparisons.running.processes import EngineProcesses

    verify_time_step(scene, dt)
    entry = present_entry(engine_name)
    with EngineProcesses(ONE_MINUTE) as processes:
        rows = processes.call(entry, _built, scene, dt)
    if isinstance(rows, Breakdown):
        raise EngineBroken(f"{entry.label} cannot build {scene.name}: {rows.reason}.")
    return rows


def _built(entry: "EngineEntry", scene: Scenario, dt: float) -> Rows:
    """The model that an engine builds; runs in the engine's process."""
    from dropspin.comparisons.running.adapter_output import verified_refusal, verified_settings, verify_build

    engine = entry.adapter
    refusal = verified_refusal(engine.refusal(scene))
    if refusal is not None:
        return [{"what": engine.label, "is": f"declines {scene.name}: {refusal}"}]
    with engine.prepare(scene, dt) as simulation:
        verify_build(engine, scene, simulation, dt)
        built, settings = simulation.as_built(), verified_settings(simulation.settings)
        rows = [("engine", engine.label, ""), ("velocity lag", f"{simulation.velocity_lag:g} s", "time by which velocity lags position")]
    if built is not None:
        rows += [
            ("mass", f"{built.mass!r} kg", "read back"),
            ("inertia", f"{built.inertia.tolist()} kg m²", "read back"),
            ("gravity", f"{built.gravity.tolist()} m/s²", "read back"),
        ]
    calibrated = settings
    if not engine.is_calibrated and verified_refusal(engine.calibrated.refusal(scene)) is None:
        with engine.calibrated.prepare(scene, dt) as simulation:
            calibrated = verified_settings(simulation.settings)
    facts = [{"what": name, "is": text, "source": "", "calibrated": "", "why": why} for name, text, why in rows]
    return facts + _setting_rows(engine, settings, calibrated)


def _setting_rows(engine: "Engine", settings: Mapping[str, Any], calibrated: Mapping[str, Any]) -> Rows:
    """The settings in force, each with its source, and with its calibrated value if it differs."""
    at_default = {name: one for name, one in engine.settings.items() if not (one.is_computed and engine.is_calibrated)}
    defaults = {name: setting.default for name, setting in at_default.items() if engine.unmet_need(name) is None}
    reasons = engine.reasons if engine.is_calibrated else {}

    def text(name: str, value: Any) -> str:
        return spelled(value) if name in engine.settings else str(value)

    def source(name: str, value: Any) -> str:
        if name in engine.options:
            return "given"
        if name not in engine.settings:
            return ""
        if text(name, value) == spelled(engine.settings[name].default):
            return "engine's default"
        return "computed" if engine.settings[name].is_computed else "calibrated"

    rows = []
    for name, value in ({**settings, **{name: defaults[name] for name in defaults if name not in settings}}).items():
        other = calibrated.get(name, defaults.get(name))
        differs = other is not None and text(name, other) != text(name, value)
        why = str(reasons.get(name, ""))
        rows.append([name, text(name, value), source(name, value), text(name, other) if differs else "", why])
    return [dict(zip(("what", "is", "source", "calibrated", "why"), row, strict=True)) for row in rows]


def setting_rows(engine_name: str) -> Rows:
    """The options of an engine and the settings of its library: default, calibrated value, allowed values.

    Raises:
        DropspinError: There is no such engine, or it cannot be imported.
    """
    from dropspin.comparisons.running.engine_entries import present_entry

    engine = present_entry(engine_name).adapter
    rows = [(name, values[0], "", " | ".join(values), "", "option of the adapter") for name, values in engine.choices.items()]
    rows += [
        (name, f"{number.default:g}", "", f"{number.least:g} … {number.most:g}", "", "option of the adapter")
        for name, number in engine.numbers.items()
    ]
    for name, setting in engine.settings.items():
        calibrated = "computed" if setting.is_computed else "" if setting.calibrated is None else spelled(setting.calibrated)
        rows.append((name, spelled(setting.default), calibrated, setting.allowed, setting.unit, setting.what))
    return [dict(zip(("name", "default", "calibrated", "allowed", "unit", "what"), row, strict=True)) for row in rows]

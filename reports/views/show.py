"""`dropspin show` in words: a scene, or what an engine builds of it."""

from comparisons.engines.registry import engine
from comparisons.judging.verdicts import verify_expectations
from comparisons.running.recording import verify_time_step
from comparisons.running.verification import verify_build
from reports.views.numbers import bound
from reports.views.run import left_out, modelled
from scenarios import Scenario, truth_for

Rows = list[dict[str, str]]


def scene_rows(scene: Scenario) -> Rows:
    """A scene: what is modelled, its truth, what it expects."""
    truth = truth_for(scene)
    verify_expectations(scene, truth, [])
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
    verify_time_step(scene, dt)
    chosen = engine(engine_name)
    refusal = chosen.declines(scene)
    if refusal is not None:
        return [{"what": chosen.label, "is": f"declines {scene.name}: {refusal}"}]
    with chosen.prepare(scene, dt) as simulation:
        verify_build(chosen, scene, simulation)
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

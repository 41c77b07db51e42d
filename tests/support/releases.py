"""An engine under test whose releases have one fault each, and runs of it: made once, cut and relabelled for each test."""

import datetime
from dataclasses import replace

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.registry import engine
from dropspin.scenarios import load

TODAY = datetime.date(2026, 3, 1)
SCENES = [load(name) for name in ("drop-ball", "drop-ball-backspin", "drop-box-corner", "fall-spin")]
SCENES.append(load("spin-asymmetric").model_copy(update={"duration": 5.0}))  # of 30 s: a sixth of the time
WITH_FLOOR = {"drop-ball", "drop-ball-backspin", "drop-box-corner"}
TURNING = {"drop-ball-backspin", "drop-box-corner", "fall-spin", "spin-asymmetric"}
DTS = [8e-3, 4e-3, 2e-3]


class Candidate(Engine):
    """An engine of a library under test."""

    name = "candidate"
    inner = "wang[rotation=rk4]"

    def order_in(self, scene):
        return None

    def declines(self, scene):
        return engine(self.inner).refusal(scene)

    def prepare(self, scene, dt):
        simulation = engine(self.inner).prepare(self.changed(scene), dt)
        simulation.settings = {"version": "1.0", "rotation": self.inner}
        return simulation

    def changed(self, scene):
        return scene


def with_restitution(scene, restitution):
    return scene.model_copy(update={"floor": scene.floor.model_copy(update={"restitution": restitution})})


class TooLively(Candidate):
    """1 % more restitution."""

    name = "too-lively"

    def changed(self, scene):
        return scene if scene.floor is None else with_restitution(scene, 1.01 * scene.floor.restitution)


class WithoutGyroscopicTerm(Candidate):
    """The update of the spin in Wang's method, which has no gyroscopic torque."""

    name = "without-gyroscopic-term"
    inner = "wang"


class Euler(Candidate):
    """Semi-implicit Euler in the place of Runge-Kutta."""

    name = "euler"
    inner = "wang[rotation=gyroscopic]"


class OnAnotherMachine(Candidate):
    """Rounds differently: the start, which the whole motion depends on, is some eps off."""

    name = "on-another-machine"

    def changed(self, scene):
        state = scene.initial_state
        return scene.starting_at(state * (1.0 + np.finfo(float).eps * np.where(np.arange(13) % 2, 1.0, -2.0)))

    def prepare(self, scene, dt):
        simulation = super().prepare(scene, dt)
        first, moved = scene.initial_state, simulation.record
        simulation.record = lambda steps, every=1: np.vstack([first, moved(steps, every)[1:]])
        simulation.state = lambda: first
        return simulation


class Broken(Candidate):
    """Crashes where there is a floor."""

    name = "broken"

    def changed(self, scene):
        if scene.floor is not None:
            raise RuntimeError("no floor today")
        return scene


class OneBadStart(Candidate):
    """Loses its restitution in one of 32 starts."""

    def changed(self, scene):
        bad = scene.floor is not None and 1.0e-3 < abs(scene.start.velocity[1]) < 1.3e-3
        return with_restitution(scene, 0.1) if bad else scene


RELEASES = [Candidate, TooLively, WithoutGyroscopicTerm, Euler, OnAnotherMachine, Broken]


TABLES = ("table", "predictions", "agreements")


def longer(scene):
    """Another scene of the same name."""
    return scene.model_copy(update={"duration": 1.1 * scene.duration})


def part(results, *scenes, engines=None, dt=None):
    """Some scenes and engines of a run, as if only these had been asked for; all scenes, engines and time steps by default."""
    names, labels = list(scenes) or list(results.scenes), tuple(engines or results.engines)
    stamp = dict(results.provenance)
    stamp["asked"] = stamp["asked"] | {"scenes": names, "engines": list(labels)}
    if dt is not None:
        stamp["asked"]["dts"] = [dt]
    stamp["settings"] = {
        label: {case: settings for case, settings in stamped.items() if case.split(" dt=")[0] in names}
        for label, stamped in stamp["settings"].items()
        if label in labels
    }
    stamp["motions"] = {name: digests for name, digests in stamp["motions"].items() if name in names}
    for table in ("names", "adapters"):
        stamp[table] = {label: content for label, content in stamp[table].items() if label in labels}
    chosen = {name: results.scenes[name] for name in names}
    tables = {}
    for table in TABLES:
        rows = getattr(results, table)
        kept = rows["scene"].isin(names) & rows["engine"].isin(labels) & ((dt is None) | (rows["dt"] == dt))
        tables[table] = rows[kept].reset_index(drop=True)
    return replace(results, **tables, scenes=chosen, engines=labels, provenance=stamp)


def relabelled(results, old, new):
    """A run with another label of an engine."""
    stamp = dict(results.provenance)
    stamp["asked"] = stamp["asked"] | {"engines": [new if label == old else label for label in stamp["asked"]["engines"]]}
    for table in ("names", "adapters", "settings"):
        stamp[table] = {new if label == old else label: content for label, content in stamp[table].items()}
    stamp["motions"] = {
        scene: {new if label == old else label: steps for label, steps in by_engine.items()}
        for scene, by_engine in stamp["motions"].items()
    }
    engines = tuple(new if label == old else label for label in results.engines)
    tables = {table: getattr(results, table).replace({"engine": {old: new}}) for table in TABLES}
    return replace(results, **tables, engines=engines, provenance=stamp)


def released(results, version):
    """A run whose candidate reports another version."""
    settings = results.provenance["settings"]
    candidate = {case: stamped | {"version": version} for case, stamped in settings["candidate"].items()}
    return replace(results, provenance={**results.provenance, "settings": settings | {"candidate": candidate}})


def failing(checked):
    """The accepted results that fail a check."""
    rows = checked.results.table
    return rows[(rows["kind"] == "baseline") & (rows["verdict"] == "failed")]

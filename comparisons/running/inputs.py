"""What callers ask for: scenes, engines and time steps, as objects or names, one or several; checked before anything runs."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.engines.base import Engine, EngineMissing
from comparisons.engines.registry import engine as engine_named
from comparisons.engines.registry import engine_names
from scenarios import DropspinError, Scenario, SceneError, load

SceneLike = Scenario | str | Path | Mapping[str, Any]
"""A scene, its catalogue name, the path of its file, or a mapping with the same keys as a file."""
FEWEST_STEPS = 4
MOST_STEPS = 2_000_000
"""Steps of one run; 32 start phases of that many fit into a machine's memory."""


@dataclass(frozen=True)
class EngineEntry:
    """An engine that takes part in a run; `missing` says why one that was asked for cannot."""

    label: str
    engine: Engine | None
    missing: str = ""


ONE_OR_SEVERAL = {
    "scenes": "a Scenario, a name such as 'drop-ball', a file's path, a mapping, or a list of these",
    "engines": "an Engine, a name such as 'mujoco', or a list of these",
    "dt": "a number of seconds, or a list of these",
}


SINGLE: dict[str, Any] = {"scenes": Scenario | str | Path | Mapping, "engines": Engine | str, "dt": int | float}


def ignore(*arguments: object) -> None:
    """The callback of a caller who gives none."""


def several(name: str, given: Any) -> list[Any]:
    """One scene, engine or time step, or several of them, as a list.

    Raises:
        DropspinError: It is neither.
    """
    if isinstance(given, SINGLE[name]):
        return [given]
    if not isinstance(given, Iterable) or isinstance(given, Mapping | str | bytes):
        raise DropspinError(f"{name}: got {given!r} ({type(given).__name__}); give {ONE_OR_SEVERAL[name]}.")
    return list(given)


def engine_entry(engine: Engine | str) -> EngineEntry:
    """An engine by its name, or an engine object, as an entry of a run.

    Raises:
        DropspinError: There is no engine of that name, or it is neither an engine nor a name.
    """
    if isinstance(engine, Engine):
        return EngineEntry(engine.label, engine)
    if not isinstance(engine, str):
        raise DropspinError(f"engine: got {_described(engine)}; give a name such as 'mujoco', or an Engine.")
    try:
        created = engine_named(engine)
    except EngineMissing as error:
        return EngineEntry(engine.strip(), None, str(error))
    return EngineEntry(created.label, created)


def installed_engine(engine: Engine | str) -> Engine:
    """An engine by its name, or an engine object.

    Raises:
        EngineMissing: A package that it needs is not installed.
        DropspinError: There is no engine of that name, or it is neither an engine nor a name.
    """
    entry = engine_entry(engine)
    if entry.engine is None:
        raise EngineMissing(entry.missing)
    return entry.engine


def as_scene(scene: SceneLike) -> Scenario:
    """A scene, or what `load` takes: a catalogue name, a file's path, or a mapping.

    Raises:
        DropspinError: It is neither, or there is no such scene.
    """
    if isinstance(scene, Scenario):
        return scene
    if not isinstance(scene, str | Path | Mapping):
        raise DropspinError(f"scene: got {_described(scene)}; give a name such as 'drop-ball', a file's path, a mapping, or a Scenario.")
    try:
        return load(scene)
    except SceneError:
        if isinstance(scene, str) and scene.partition("[")[0].strip() in engine_names():
            raise DropspinError(f"scene {scene!r} is an engine; give the scene first and the engine second.") from None
        raise


def verify_time_step(scene: Scenario, dt: float) -> None:
    """Raise `DropspinError` unless a scene is a sensible number of steps of dt [s]."""
    if isinstance(dt, bool) or not isinstance(dt, int | float | np.floating):
        raise DropspinError(f"dt: got {_described(dt)}; a time step is a number of seconds.")
    if not (np.isfinite(dt) and dt > 0.0 and FEWEST_STEPS <= scene.duration / dt + 1e-9 <= MOST_STEPS):
        raise DropspinError(
            f"dt: got {dt!r} s; scene {scene.name!r} lasts {scene.duration:g} s, so a step must be "
            f"at least {scene.duration / MOST_STEPS:g} s and at most {scene.duration / FEWEST_STEPS:g} s."
        )


def _described(value: object) -> str:
    """A value of a wrong type for a message: its type, and the value if it is short."""
    text = repr(value)
    return f"{text} ({type(value).__name__})" if len(text) <= 40 else f"a {type(value).__name__}"

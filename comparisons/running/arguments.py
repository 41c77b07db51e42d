"""What callers ask for: scenes, engines and time steps, as objects or names, one or several; checked before anything runs."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.options import engine_name
from dropspin.comparisons.engines.registry import engine_names
from dropspin.scenarios import DropspinError, Scenario, SceneError, load
from dropspin.scenarios.text import counted

SceneLike = Scenario | str | Path | Mapping[str, Any]
"""A scene, its catalogue name, the path of its file, or a mapping with the same keys as a file."""
DEFAULT_DTS = (4e-3, 2e-3, 1e-3)
"""Time steps of a run for which none are given [s]."""
FEWEST_STEPS = 4
MOST_STEPS = 2_000_000
"""Steps of a motion."""
MOST_ROWS, MOST_STATES = 400_000, 2_000_000
"""Steps of a run from one start, and from all start phases together; states of the motions that it compares, one of each engine and three
more. With what is computed of them they take less than 1 GiB, also where half of the finest time step is added.
"""


@dataclass(frozen=True)
class EngineEntry:
    """An engine that takes part in a run.

    Attributes:
        label: Its label; of one that cannot take part, what it was asked for by.
        engine: The engine, or its stand-in outside its process; None for one that cannot take part.
        absence: Why it cannot take part: it is not installed, or broken.
        reason: The same in a sentence.
    """

    label: str
    engine: Engine | None
    absence: Literal["", "missing", "broken"] = ""
    reason: str = ""

    @property
    def adapter(self) -> Engine:
        """The engine of an entry that can take part."""
        assert self.engine is not None
        return self.engine


ONE_OR_SEVERAL = {
    "scenes": "a Scenario, a name such as 'drop-ball', a file's path, a mapping, or a list of these",
    "engines": "an Engine, a name such as 'mujoco', or a list of these",
    "dt": "a number of seconds, or a list of these",
}


SINGLE: dict[str, Any] = {"scenes": Scenario | str | Path | Mapping, "engines": Engine | str, "dt": int | float | np.floating}


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


def as_scene(scene: SceneLike) -> Scenario:
    """A scene, or what `load` takes: a catalogue name, a file's path, or a mapping.

    Raises:
        DropspinError: It is neither, or there is no such scene.
    """
    if isinstance(scene, Scenario):
        return scene
    if not isinstance(scene, str | Path | Mapping):
        raise DropspinError(
            f"scene: got {described_value(scene)}; give a name such as 'drop-ball', a file's path, a mapping, or a Scenario."
        )
    try:
        return load(scene)
    except SceneError:
        if isinstance(scene, str) and engine_name(scene).strip() in engine_names():
            raise DropspinError(f"scene {scene!r} is an engine; give the scene first and the engine second.") from None
        raise


def as_scenes(scenes: SceneLike | Iterable[SceneLike], default: Iterable[str] = ()) -> list[Scenario]:
    """One scene or several, or default ones if none is given.

    Raises:
        DropspinError: There is no such scene, or two have the same name.
    """
    chosen = [as_scene(scene) for scene in several("scenes", scenes) or default]
    names = [scene.name for scene in chosen]
    if len(set(names)) < len(names):
        raise DropspinError(f"two scenes have the same name ({', '.join(names)}); rename a file, or give a mapping a 'name'.")
    return chosen


def verify_time_step(scene: Scenario, dt: float, engines: int = 0) -> None:
    """Raise `DropspinError` unless a scene is a sensible number of steps of dt [s], also for a run that compares `engines`."""
    most = min(MOST_ROWS, MOST_STATES // (engines + 3)) if engines else MOST_STEPS
    so_that = f" in a run of {counted(engines, 'engine')}, whose motions are in memory together" if engines else ""
    if isinstance(dt, bool) or not isinstance(dt, int | float | np.floating):
        raise DropspinError(f"dt: got {described_value(dt)}; a time step is a number of seconds.")
    if not (np.isfinite(dt) and dt > 0.0 and FEWEST_STEPS <= scene.duration / dt + 1e-9 < most + 1):
        allowed = f"least {scene.duration / most:.10g} s{so_that}"
        if dt * FEWEST_STEPS > scene.duration:
            allowed = f"most {scene.duration / FEWEST_STEPS:.10g} s"
        raise DropspinError(f"dt: got {dt!r} s; scene {scene.name!r} lasts {scene.duration:g} s, so a step must be at {allowed}.")


def described_value(value: object) -> str:
    """A value of a wrong type for a message: its type, and the value if it is short."""
    text = repr(value)
    return f"{text} ({type(value).__name__})" if len(text) <= 40 else f"a {type(value).__name__}"

"""The spec of a sweep: a TOML file, checked before anything runs."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from comparisons.engines.registry import engine
from comparisons.measuring.metrics import METRICS
from comparisons.running.recording import verify_time_step
from comparisons.sweeps.axes import Drawn, Listed, Spaced, Spacing, SweepAxis
from comparisons.sweeps.fields import NoSuchField, assert_has, with_fields
from comparisons.sweeps.jobs import OPTION, Sweep, configured
from reference_impl.summary import FIGURES
from scenarios import DropspinError, Scenario, SceneError, load
from scenarios.body import Number, Positive, Table
from scenarios.errors import UnknownName
from scenarios.loading import read_toml
from scenarios.validation import validated

MOST_JOBS = 10**15
WHOLE_NUMBERS = frozenset({"ensemble.size", "ensemble.seed"})


def _different(values: tuple[Any, ...]) -> tuple[Any, ...]:
    if len({repr(value) for value in values}) < len(values):
        raise ValueError("names one twice; name each once")
    return values


Count = Annotated[int, Field(strict=True, ge=1, le=MOST_JOBS)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**62)]
Names = Annotated[tuple[Annotated[str, Field(strict=True)], ...], Field(min_length=1), AfterValidator(_different)]


class Range(Table):
    """From one number to another."""

    first: Annotated[Number, Field(alias="from")]
    last: Annotated[Number, Field(alias="to")]
    spacing: Spacing = "linear"

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Self:
        if self.first >= self.last:
            raise ValueError(f"goes from {self.first:g} to {self.last:g}; it must go up")
        if self.spacing == "log" and self.first <= 0.0:
            raise ValueError(f"goes from {self.first:g}; with spacing 'log' it must start above 0")
        if not math.isfinite(self.last / self.first if self.spacing == "log" else self.last - self.first):
            raise ValueError(f"goes from {self.first:g} to {self.last:g}; that is farther than what numbers can hold")
        return self


class CountedRange(Range):
    """So many numbers, the ends among them."""

    count: Annotated[Count, Field(ge=2)]


class Draws(Table):
    """How many draws, and which."""

    count: Count
    seed: Seed


class Spec(Table):
    """A spec as it is written."""

    scenes: Names
    engines: Names
    dts: Annotated[tuple[Positive, ...], AfterValidator(_different)] = ()
    seeds: Count | Annotated[tuple[Seed, ...], Field(min_length=1), AfterValidator(_different)] | None = None
    metrics: Annotated[tuple[str, ...], AfterValidator(_different)] = ()
    grid: dict[str, Any] = Field(default_factory=dict)
    random: dict[str, Any] = Field(default_factory=dict)


def load_sweep(spec: str | Path | Mapping[str, Any]) -> Sweep:
    """The sweep of a spec: the path of a TOML file, or a mapping with the same keys. Paths of scenes are seen from the file.

    Raises:
        DropspinError: It is no spec, or a scene, an engine, a field or a value in it is none. The text says which.
    """
    if isinstance(spec, Mapping):
        where, content, folder = "spec", spec, Path()
    else:
        where, content, folder = str(spec), read_toml(Path(spec), str(spec), "spec"), Path(spec).parent
    written = validated(Spec, where, content)
    axes = _grid(where, written.grid)
    drawn = _random(where, written.random)
    names = [axis.name for axis in (*axes, *drawn)]
    for name in names:
        if names.count(name) > 1:
            raise DropspinError(f"{where}: {name}: is in [grid] and in [random]; it can be in one of them.")
    _assert_apart(where, names)
    if ("dt" in names) == bool(written.dts):
        fault = "is given twice" if written.dts else "is missing"
        raise DropspinError(f"{where}: the time step {fault}; give dts = [...], or dt in [grid] or [random] [s].")
    for metric in written.metrics:
        if metric not in METRICS:
            raise UnknownName(f"{where}: metric", metric, METRICS)
        if metric in FIGURES:
            raise DropspinError(f"{where}: metrics: {metric!r} is measured in every sweep; leave it out.")
    sweep = Sweep(
        scenes=tuple(_scene(where, name, folder) for name in written.scenes),
        engines=tuple(engine(name) for name in written.engines),
        dts=written.dts,
        seeds=range(written.seeds) if isinstance(written.seeds, int) else written.seeds,
        axes=(*axes, *drawn),
        draws=len(drawn[0]) if drawn else 1,
        metrics=written.metrics,
    )
    _assert_sound(where, sweep)
    return sweep


def _scene(where: str, name: str, folder: Path) -> Scenario:
    try:
        return load(folder / name if name.endswith(".toml") else name)
    except SceneError as error:
        raise DropspinError(f"{where}: scenes: {error}") from None


def _flat(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Axes by their whole names: TOML reads floor.restitution without quotes as a table in a table."""
    found = {}
    for key, value in table.items():
        is_table = isinstance(value, Mapping) and not {"from", "to", "count"} & value.keys()
        for name, given in (_flat(value, f"{before}{key}.") if is_table else {f"{before}{key}": value}).items():
            if name in found:
                raise DropspinError(f"{name}: is given twice; give it once.")
            found[name] = given
    return found


def _grid(where: str, table: Mapping[str, Any]) -> list[SweepAxis]:
    axes: list[SweepAxis] = []
    for name, given in _flat(table).items():
        here = f"{where}: grid: {name}"
        if isinstance(given, Mapping):
            span = validated(CountedRange, here, given)
            axes.append(Spaced(name, span.first, span.last, span.count, span.spacing))
        elif isinstance(given, list) and given:
            values = tuple(_canonical(here, name, value) for value in given)
            axes.append(Listed(name, values))
            if len({repr(value) for value in values}) < len(values):
                raise DropspinError(f"{here}: names a value twice; name each once.")
        else:
            raise DropspinError(f"{here}: got {given!r}; must be a list of values, or {{from, to, count}}.")
    return axes


def _canonical(here: str, name: str, value: Any) -> Any:
    """One way to write each value, so that equal jobs have equal keys: numbers as floats, no friction as a word."""
    if isinstance(value, list):
        return [_canonical(here, name, part) for part in value]
    if type(value) is int and name not in WHOLE_NUMBERS:
        try:
            value = float(value)
        except OverflowError:
            raise DropspinError(f"{here}: got a whole number of {len(str(value))} digits; that is beyond what numbers can hold.") from None
    if not isinstance(value, int | float | str):
        raise DropspinError(f"{here}: got {value!r}; a value is a number, a word, or a list of them.")
    if value == 0.0 and type(value) is float:
        return "none" if name == "floor.friction" else 0.0
    return value


def _random(where: str, table: Mapping[str, Any]) -> list[SweepAxis]:
    if not table:
        return []
    size = validated(Draws, f"{where}: random", {key: table[key] for key in ("count", "seed") if key in table})
    spans = _flat({key: value for key, value in table.items() if key not in ("count", "seed")})
    axes: list[SweepAxis] = []
    for name, given in spans.items():
        here = f"{where}: random: {name}"
        if not isinstance(given, Mapping):
            raise DropspinError(f"{here}: got {given!r}; must be a range to draw from, {{from, to}}.")
        span = validated(Range, here, given)
        axes.append(Drawn(name, span.first, span.last, size.count, span.spacing, size.seed))
    if not axes:
        raise DropspinError(f"{where}: random: nothing to draw; name a field and its range, such as body.mass = {{from = 1.0, to = 2.0}}.")
    return axes


def _assert_apart(where: str, names: list[str]) -> None:
    """Raise `DropspinError` if one axis sets a part of what another sets."""
    for whole in names:
        for part in names:
            if part.startswith((f"{whole}.", f"{whole}[")):
                raise DropspinError(f"{where}: {part}: sets what {whole} sets; leave one of them out.")


def _assert_sound(where: str, sweep: Sweep) -> None:
    """Raise `DropspinError` for what is wrong whatever it is combined with."""
    if len({scene.name for scene in sweep.scenes}) < len(sweep.scenes):
        raise DropspinError(f"{where}: scenes: two have the same name; a scene's name is its file's, rename one.")
    if len({engine.label for engine in sweep.engines}) < len(sweep.engines):
        raise DropspinError(f"{where}: engines: one is named twice, written in two ways; name each once.")
    if sweep.size > MOST_JOBS:
        raise DropspinError(f"{where}: these are {sweep.size:.3g} jobs; more than {MOST_JOBS:g} are not numbered.")
    for scene in sweep.scenes:
        if sweep.seeds is not None and scene.ensemble is None:
            raise DropspinError(f"{where}: seeds: scene {scene.name!r} has no [ensemble], which says how starts are spread.")
    for axis in sweep.axes:
        here = f"{where}: {'random' if isinstance(axis, Drawn) else 'grid'}: {axis.name}"
        try:
            for value in axis.extremes:
                _assert_allowed(sweep, axis, value)
        except DropspinError as error:
            raise DropspinError(f"{here}: {error}") from None
    for scene in sweep.scenes:
        for dt in sweep.dts:
            try:
                verify_time_step(scene, dt)
            except DropspinError:
                # A duration that is swept may be longer; a job that is too short says so in its row.
                if not any(axis.name == "duration" for axis in sweep.axes):
                    raise


def _assert_allowed(sweep: Sweep, axis: SweepAxis, value: Any) -> None:
    if axis.name == "dt":
        if type(value) is not float or not 0.0 < value < math.inf:
            raise DropspinError(f"got {value!r}; a time step is a number above 0, in s.")
    elif axis.name.startswith(OPTION):
        for chosen in sweep.engines:
            if axis.name.removeprefix(OPTION) in chosen.options:
                raise DropspinError(f"{chosen.label} has this option set already; leave it out there, or here.")
            configured(chosen, [(axis.name, value)])
    else:
        if axis.name.startswith("ensemble") and sweep.seeds is None:
            raise DropspinError("an ensemble's spread counts with seeds only, which say how many of its starts are run.")
        for scene in sweep.scenes:
            assert_has(scene, axis.name)
            _assert_some_scene(sweep, scene, axis, value)


def _assert_some_scene(sweep: Sweep, scene: Scenario, axis: SweepAxis, value: Any) -> None:
    """Raise what the scene says to a value, if it does so with the other fields as they are, at their first and at their last."""
    others = [other for other in sweep.axes if other.name not in (axis.name, "dt") and not other.name.startswith(OPTION)]
    refusals = []
    for place in (None, 0, -1):
        company = [] if place is None else [(other.name, other.extremes[place]) for other in others]
        try:
            with_fields(scene, [*company, (axis.name, value)])
        except SceneError as error:
            refusals.append(error)
        except (KeyError, IndexError, TypeError):
            raise NoSuchField(f"scene {scene.name!r} has no such field.") from None
        else:
            return
    raise refusals[0]

"""The spec of a sweep: a TOML file or a mapping, verified before anything runs."""

import math
from collections.abc import Iterator, Mapping
from itertools import permutations
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, ConfigDict, Field, model_validator

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.running.arguments import verify_time_step
from dropspin.comparisons.running.engine_entries import present_entry
from dropspin.comparisons.sweeps.axes import Drawn, Listed, Spaced, Spacing, SweepAxis
from dropspin.comparisons.sweeps.jobs import OPTION, Sweep, configured
from dropspin.comparisons.sweeps.outcomes import STANDARD_METRICS
from dropspin.scenarios import DropspinError, Scenario, SceneError, load
from dropspin.scenarios.errors import verify_known
from dropspin.scenarios.field_names import NoSuchField, verify_field, with_fields
from dropspin.scenarios.field_types import Number, Positive, Table
from dropspin.scenarios.loading import TOO_LARGE, read_toml
from dropspin.scenarios.validation import shown, validated

MOST_JOBS = 10**15
WHOLE_NUMBERS = frozenset({"ensemble.size", "ensemble.seed"})


def _unique(values: tuple[Any, ...]) -> tuple[Any, ...]:
    if len(set(map(repr, values))) < len(values):
        raise ValueError("names one twice; name each once")
    return values


Count = Annotated[int, Field(strict=True, ge=1, le=MOST_JOBS)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**62)]
Names = Annotated[tuple[Annotated[str, Field(strict=True)], ...], Field(min_length=1), AfterValidator(_unique)]


class Range(Table):
    """A range of numbers."""

    first: Annotated[Number, Field(alias="from")]
    last: Annotated[Number, Field(alias="to")]
    spacing: Spacing = "linear"

    @model_validator(mode="after")
    def _increases(self) -> Self:
        if self.first >= self.last:
            raise ValueError(f"from {self.first:g} to {self.last:g} does not increase; 'to' must be greater than 'from'")
        if self.spacing == "log" and self.first <= 0.0:
            raise ValueError(f"starts at {self.first:g}; with spacing 'log' it must start above 0")
        if not math.isfinite(self.last / self.first if self.spacing == "log" else self.last - self.first):
            raise ValueError(f"from {self.first:g} to {self.last:g} exceeds the range of floating-point numbers")
        return self


class CountedRange(Range):
    """A number of values in a range, both ends included."""

    count: Annotated[Count, Field(ge=2)]


class Draws(Table):
    """The number of random draws, their seed, and by further keys the ranges of fields."""

    model_config = ConfigDict(extra="allow")

    count: Count
    seed: Seed


class Spec(Table):
    """The content of a spec."""

    scenes: Names
    engines: Names
    dts: Annotated[tuple[Positive, ...], AfterValidator(_unique)] = ()
    seeds: Count | Annotated[tuple[Seed, ...], Field(min_length=1), AfterValidator(_unique)] | None = None
    metrics: Annotated[tuple[str, ...], AfterValidator(_unique)] = ()
    grid: dict[str, Any] = Field(default_factory=dict)
    random: dict[str, Any] = Field(default_factory=dict)


def load_sweep(spec: str | Path | Mapping[str, Any]) -> Sweep:
    """Load the spec of a sweep.

    Args:
        spec: The path of a TOML file, or a mapping with the same keys. Paths of scenes are relative to the file.

    Returns:
        The sweep, for `run_sweep`; its `size` is the number of jobs.

    Raises:
        DropspinError: The spec, or a scene, an engine, a field or a value in it, is not valid. The message says which.
    """
    if isinstance(spec, Mapping):
        where, content, folder = "spec", spec, Path()
    else:
        where, content, folder = str(spec), read_toml(Path(spec), str(spec), "spec"), Path(spec).parent
    written = validated(Spec, where, content)
    axes, draws = _axes(f"{where}: grid", written.grid), None
    if written.random:
        draws = validated(Draws, f"{where}: random", written.random)
        axes += _axes(f"{where}: random", draws.model_extra or {}, draws)
        if not draws.model_extra:
            example = "body.mass = {from = 1.0, to = 2.0}"
            raise DropspinError(f"{where}: random: no field is given; add one with its range, such as {example}.")
    sweep = Sweep(
        scenes=tuple(_scene(where, name, folder) for name in written.scenes),
        engines=tuple(present_entry(name).adapter for name in written.engines),
        dts=written.dts,
        seeds=range(written.seeds) if isinstance(written.seeds, int) else written.seeds,
        axes=tuple(axes),
        draws=1 if draws is None else draws.count,
        metrics=written.metrics,
    )
    _verify_names(where, sweep)
    _verify_sweep(where, sweep)
    return sweep


def _scene(where: str, name: str, folder: Path) -> Scenario:
    try:
        return load(folder / name if name.endswith(".toml") else name)
    except SceneError as error:
        raise DropspinError(f"{where}: scenes: {error}") from None


def _flattened(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Fields by their dotted names: TOML reads floor.restitution without quotes as a table in a table."""
    for key, value in table.items():
        if isinstance(value, Mapping) and not {"from", "to", "count"} & value.keys():
            yield from _flattened(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _axes(where: str, table: Mapping[str, Any], draws: Draws | None = None) -> list[SweepAxis]:
    """The axes of the table [grid], or of [random] with its draws."""
    axes: list[SweepAxis] = []
    for name, entry in _flattened(table):
        here = f"{where}: {name}"
        if any(axis.name == name for axis in axes):
            raise DropspinError(f"{here}: is given twice; give it once.")
        if isinstance(entry, Mapping) and draws is None:
            axes.append(Spaced(name, **validated(CountedRange, here, entry).model_dump()))
        elif isinstance(entry, Mapping) and draws is not None:
            axes.append(Drawn(name, **validated(Range, here, entry).model_dump(), count=draws.count, seed=draws.seed))
        elif isinstance(entry, list) and entry and draws is None:
            values = tuple(_canonical(here, name, value) for value in entry)
            if len(set(map(repr, values))) < len(values):
                raise DropspinError(f"{here}: names a value twice; name each once.")
            axes.append(Listed(name, values))
        else:
            allowed = "a list of values, or {from, to, count}" if draws is None else "a range to draw from, {from, to}"
            raise DropspinError(f"{here}: got {shown(entry)}; must be {allowed}.")
    return axes


def _canonical(here: str, name: str, value: Any) -> Any:
    """The canonical form of a value, so that equal jobs have equal keys: numbers are floats, and no friction is a word."""
    if isinstance(value, list):
        return [_canonical(here, name, part) for part in value]
    if type(value) is int:
        try:
            number = float(value)
        except OverflowError:
            raise DropspinError(f"{here}: got a whole number {TOO_LARGE}.") from None
        value = value if name in WHOLE_NUMBERS else number
    if not isinstance(value, int | float | str):
        raise DropspinError(f"{here}: got {shown(value)}; a value is a number, a word, or a list of them.")
    if value == 0.0 and type(value) is float:
        return "none" if name == "floor.friction" else 0.0
    return value


def _verify_names(where: str, sweep: Sweep) -> None:
    """Raise `DropspinError` if a scene, an engine, a field or a metric is named twice or the time step is not named once."""
    names = [axis.name for axis in sweep.axes]
    for name, other in permutations(names, 2):
        if name == other:
            raise DropspinError(f"{where}: {name}: is in both [grid] and [random]; remove it from one of them.")
        if other.startswith((f"{name}.", f"{name}[")):
            raise DropspinError(f"{where}: {other}: is a part of {name}, which is swept as well; leave one of them out.")
    if ("dt" in names) == bool(sweep.dts):
        fault = "is given twice" if sweep.dts else "is missing"
        raise DropspinError(f"{where}: the time step {fault}; give dts = [...], or dt in [grid] or [random] [s].")
    verify_known(f"{where}: metric", sweep.metrics, METRICS)
    for metric in sweep.metrics:
        if metric in STANDARD_METRICS:
            raise DropspinError(f"{where}: metrics: {metric!r} is measured in every sweep; leave it out.")
    if len({scene.name for scene in sweep.scenes}) < len(sweep.scenes):
        raise DropspinError(f"{where}: scenes: two have the same name, which is that of the file; rename one.")
    if len({engine.label for engine in sweep.engines}) < len(sweep.engines):
        raise DropspinError(f"{where}: engines: the same engine is named twice, written in two ways; name each once.")


def _verify_sweep(where: str, sweep: Sweep) -> None:
    """Raise `DropspinError` for a fault that does not depend on the combination of values."""
    if sweep.size > MOST_JOBS:
        raise DropspinError(f"{where}: the sweep has {sweep.size:.3g} jobs; at most {MOST_JOBS:g} are allowed.")
    for scene in sweep.scenes:
        if sweep.seeds is not None and scene.ensemble is None:
            raise DropspinError(f"{where}: seeds: scene {scene.name!r} has no [ensemble], which defines the spread of starts.")
    for axis in sweep.axes:
        try:
            for value in axis.values:
                _verify_value(sweep, axis, value)
        except DropspinError as error:
            table = "random" if isinstance(axis, Drawn) else "grid"
            raise DropspinError(f"{where}: {table}: {axis.name}: {error}") from None
    if any(axis.name == "duration" for axis in sweep.axes):
        return  # whether a time step fits depends on the job, and is reported in its row
    for scene in sweep.scenes:
        for dt in sweep.dts:
            verify_time_step(scene, dt)


def _verify_value(sweep: Sweep, axis: SweepAxis, value: Any) -> None:
    if axis.name == "dt":
        if type(value) is not float or not 0.0 < value < math.inf:
            raise DropspinError(f"got {shown(value)}; a time step is a number above 0, in s.")
    elif axis.name.startswith(OPTION):
        for chosen in sweep.engines:
            if axis.name.removeprefix(OPTION) in chosen.options:
                raise DropspinError(f"{chosen.label} sets this option as well; leave it out there or here.")
            configured(chosen, [(axis.name, value)])
    else:
        if axis.name.startswith("ensemble") and sweep.seeds is None:
            raise DropspinError("the spread of an ensemble has an effect only with seeds, which select its starts.")
        for scene in sweep.scenes:
            verify_field(scene, axis.name)
            _verify_some_scene(sweep, scene, axis, value)


def _verify_some_scene(sweep: Sweep, scene: Scenario, axis: SweepAxis, value: Any) -> None:
    """Raise the scene's error for a value if it is raised with the other fields at the scene's values, at their first and at their last."""
    others = [other for other in sweep.axes if other.name not in (axis.name, "dt") and not other.name.startswith(OPTION)]
    errors = []
    for company in ([], *([(other.name, other.values[index]) for other in others] for index in (0, -1))):
        try:
            with_fields(scene, [*company, (axis.name, value)])
            return
        except SceneError as error:
            errors.append(error)
        except (KeyError, IndexError, TypeError):
            raise NoSuchField(f"scene {scene.name!r} has no such field.") from None
    raise errors[0]

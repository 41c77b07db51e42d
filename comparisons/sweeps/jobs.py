"""The jobs of a sweep: each follows from its number alone, and is computed when it is needed."""

import hashlib
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic_core import to_json

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.sweeps.axes import Drawn, Indices, SweepAxis
from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.ensemble import spread_start
from dropspin.scenarios.field_names import content_of, path_of, set_field, with_fields
from dropspin.scenarios.state import Array
from dropspin.scenarios.validation import shown

OPTION = "engine."
KEY_DIGITS = 20
"""Hexadecimal digits of a job's key: among a billion jobs, the probability that two share a key is one in a million."""


@dataclass(frozen=True)
class Jobs:
    """Some jobs of one scene and one engine.

    Attributes:
        scene: The scene of the spec.
        engine: The engine of the spec.
        numbers: Numbers of the jobs, shape (n,).
        dts: Time steps [s], shape (n,).
        seeds: Numbers of the starts, shape (n,); None where every job starts as its scene says.
        values: For each axis, by its name, the values of the jobs, shape (n,).
    """

    scene: Scenario
    engine: Engine
    numbers: Indices
    dts: Array
    seeds: Indices | None
    values: dict[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, indices: slice | NDArray[Any]) -> "Jobs":
        """Some of the jobs."""
        seeds = None if self.seeds is None else self.seeds[indices]
        values = {name: column[indices] for name, column in self.values.items()}
        return Jobs(self.scene, self.engine, self.numbers[indices], self.dts[indices], seeds, values)

    @property
    def fields(self) -> dict[str, NDArray[Any]]:
        """The values that set fields of the scene."""
        return {name: column for name, column in self.values.items() if not name.startswith(OPTION)}

    def engine_at(self, index: int) -> Engine:
        """The engine of a job, with its options."""
        return configured(self.engine, [(name, column[index]) for name, column in self.values.items() if name.startswith(OPTION)])

    def labels(self) -> list[str]:
        """The canonical name of each job's engine, with its options."""
        if len(self.fields) == len(self.values):  # no axis sets an option
            return [self.engine.label] * len(self)
        return [self.engine_at(index).label for index in range(len(self))]

    def starts(self) -> list[int | None]:
        """The number of each job's start; None for the scene's own."""
        return [None] * len(self) if self.seeds is None else list(map(int, self.seeds))

    def hashes(self) -> list[str]:
        """A short hash of each job's physics, engine, time step and start; the other jobs of the sweep do not change it."""
        content = content_of(self.scene)
        if self.seeds is None:
            content.pop("ensemble", None)  # which then has no effect
        for place, name in enumerate(self.fields):
            set_field(content, path_of(name), f"<{place}>")
        pieces = re.split(rb'"<(\d+)>"', to_json(content))  # every second one is the place of a field
        columns = [_as_json(list(self.fields.values())[int(place)]) for place in pieces[1::2]]
        keys = []
        for label, dt, seed, *values in zip(self.labels(), self.dts.tolist(), self.starts(), *columns, strict=True):
            pieces[1::2] = values
            pieces_and_start = b"".join(pieces) + f"\n{label}\n{dt!r}\n{seed}".encode()
            keys.append(hashlib.sha256(pieces_and_start).hexdigest()[:KEY_DIGITS])
        return keys


@dataclass(frozen=True)
class Sweep:
    """The product scenes × engines × time steps × starts × grid × draws; the last factor varies fastest.

    Attributes:
        scenes: The scenes.
        engines: The engines.
        dts: Time steps [s]; empty where one of the axes is the time step.
        seeds: Numbers of starts of the scenes' ensembles; None for the scenes' own starts.
        axes: The axes of the grid, then the random ones.
        draws: Number of random draws.
        metrics: Names of the metrics that are measured in addition to the standard ones.
    """

    scenes: tuple[Scenario, ...]
    engines: tuple[Engine, ...]
    dts: tuple[float, ...]
    seeds: Sequence[int] | None
    axes: tuple[SweepAxis, ...]
    draws: int
    metrics: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """The length of each factor of the product."""
        grid = [len(axis) for axis in self.axes if not isinstance(axis, Drawn)]
        return len(self.scenes), len(self.engines), len(self.dts) or 1, len(self.seeds or (0,)), *grid, self.draws

    @property
    def size(self) -> int:
        """The number of jobs."""
        return math.prod(self.shape)

    def jobs(self, first: int, last: int) -> list[Jobs]:
        """The jobs from number `first` up to, not including, `last`, in order; one item for each scene and engine."""
        numbers = np.arange(first, last)
        size = math.prod(self.shape[2:])
        edges = [first, *range((first // size + 1) * size, last, size), last]
        return [self._of_one_engine(numbers[low - first : high - first]) for low, high in pairwise(edges)]

    def _of_one_engine(self, numbers: Indices) -> Jobs:
        """The jobs with these numbers, which must have the same scene and engine."""
        scene, engine, step, start, *grid, draw = np.unravel_index(numbers, self.shape)
        grid_indices = iter(grid)
        values = {axis.name: axis.at(draw if isinstance(axis, Drawn) else next(grid_indices)) for axis in self.axes}
        dts = values.pop("dt", None)
        return Jobs(
            self.scenes[scene[0]],
            self.engines[engine[0]],
            numbers,
            np.array(self.dts)[step] if dts is None else dts,
            None if self.seeds is None else np.array([self.seeds[index] for index in start], dtype=np.int64),
            values,
        )


def configured(engine: Engine, options: Iterable[tuple[str, Any]]) -> Engine:
    """An engine with some of its options set, by the names of their axes; numbers keep all their digits.

    Raises:
        DropspinError: The option does not exist, or the value is not allowed.
    """
    chosen = {}
    for name, value in options:
        if not isinstance(value, str | float):
            raise DropspinError(f"got {shown(value)}; the value of an option is a word or a number.")
        chosen[name.removeprefix(OPTION)] = value if isinstance(value, str) else repr(float(value))
    return type(engine)({**engine.options, **chosen}) if chosen else engine


def _as_json(column: NDArray[Any]) -> list[bytes]:
    if column.dtype == object:
        return [to_json(value) for value in column]
    return to_json(column.tolist())[1:-1].split(b",")


def scene_of(jobs: Jobs, index: int) -> Scenario:
    """The scene of a job, with its fields set and from its start.

    Raises:
        SceneError: The fields do not make a valid scene.
    """
    scene = with_fields(jobs.scene, [(name, column[index]) for name, column in jobs.fields.items()])
    return scene if jobs.seeds is None else scene.starting_at(spread_start(scene, int(jobs.seeds[index])))

"""The jobs of a sweep, by number: what each is follows from its number, and none is held before it is asked for."""

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic_core import to_json

from comparisons.engines.base import Engine
from comparisons.sweeps.axes import Drawn, SweepAxis
from comparisons.sweeps.fields import content_of, path_of, put
from scenarios import DropspinError, Scenario

OPTION = "engine."
KEY_DIGITS = 20  # of a billion jobs two share one with a chance of one in a million
Whole = NDArray[np.int64]


@dataclass(frozen=True)
class Jobs:
    """Some jobs of one scene and one engine.

    Attributes:
        scene: The scene as written.
        engine: The engine as named.
        numbers: Their numbers, shape (n,).
        dts: Time steps [s], shape (n,).
        seeds: The numbers of their starts, shape (n,), or None: the scene's own.
        values: By the name of an axis, what it sets for each; shape (n,).
    """

    scene: Scenario
    engine: Engine
    numbers: Whole
    dts: NDArray[np.float64]
    seeds: Whole | None
    values: dict[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, places: slice | NDArray[Any]) -> "Jobs":
        """Some of them."""
        seeds = None if self.seeds is None else self.seeds[places]
        values = {name: column[places] for name, column in self.values.items()}
        return Jobs(self.scene, self.engine, self.numbers[places], self.dts[places], seeds, values)

    @property
    def fields(self) -> dict[str, NDArray[Any]]:
        """The values that are of the scene."""
        return {name: column for name, column in self.values.items() if not name.startswith(OPTION)}

    def engine_at(self, place: int) -> Engine:
        """The engine of a job, with its options."""
        return configured(self.engine, [(name, column[place]) for name, column in self.values.items() if name.startswith(OPTION)])

    def labels(self) -> list[str]:
        """The canonical name of each's engine, with its options."""
        if len(self.fields) == len(self.values):  # no options among them
            return [self.engine.label] * len(self)
        return [self.engine_at(place).label for place in range(len(self))]

    def starts(self) -> list[int | None]:
        """The number of each's start; None for the scene's own."""
        return [None] * len(self) if self.seeds is None else list(map(int, self.seeds))

    def hashes(self) -> list[str]:
        """A short hash of what moves each body and how it is run, whatever other jobs there are."""
        content = content_of(self.scene)
        content.pop("ensemble" if self.seeds is None else "", None)  # which moves nothing then
        for place, name in enumerate(self.fields):
            put(content, path_of(name), f"<{place}>")
        template = to_json(content)
        order = sorted(range(len(self.fields)), key=lambda place: template.index(b'"<%d>"' % place))
        pieces, rest = [], template
        for place in order:
            piece, _, rest = rest.partition(b'"<%d>"' % place)
            pieces.append(piece)
        columns = [_as_json(list(self.fields.values())[place]) for place in order]
        keys = []
        for label, dt, seed, *values in zip(self.labels(), self.dts.tolist(), self.starts(), *columns, strict=True):
            told = b"".join([part for pair in zip(pieces, values, strict=True) for part in pair])
            text = told + rest + f"\n{label}\n{dt!r}\n{seed}".encode()
            keys.append(hashlib.sha256(text).hexdigest()[:KEY_DIGITS])
        return keys


@dataclass(frozen=True)
class Sweep:
    """Scenes × engines × steps × starts × every combination of the grid × draws; the last goes round fastest.

    Attributes:
        dts: Time steps [s]; empty where one of the axes is the step.
        seeds: Numbers of starts from the scenes' spread, or None: the scenes' own starts.
        axes: Of the grid, then those that are drawn.
        draws: How often these are drawn.
        metrics: Metrics of the truth that are measured of each job.
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
        """How many there are of each."""
        grid = [len(axis) for axis in self.axes if not isinstance(axis, Drawn)]
        return len(self.scenes), len(self.engines), len(self.dts) or 1, len(self.seeds or (0,)), *grid, self.draws

    @property
    def size(self) -> int:
        """How many jobs there are."""
        return math.prod(self.shape)

    def jobs(self, first: int, last: int) -> list[Jobs]:
        """The jobs from number `first` up to, not including, `last`; those of one scene and engine together, in order."""
        numbers = np.arange(first, last)
        each = math.prod(self.shape[2:])
        edges = [first, *range((first // each + 1) * each, last, each), last]
        return [self._alike(numbers[low - first : high - first]) for low, high in pairwise(edges)]

    def _alike(self, numbers: Whole) -> Jobs:
        scene, engine, step, start, *grid, draw = np.unravel_index(numbers, self.shape)
        places = iter(grid)
        values = {axis.name: axis.at(draw if isinstance(axis, Drawn) else next(places)) for axis in self.axes}
        dts = values.pop("dt", None)
        return Jobs(
            self.scenes[scene[0]],
            self.engines[engine[0]],
            numbers,
            np.array(self.dts)[step] if dts is None else dts,
            None if self.seeds is None else np.array([self.seeds[place] for place in start], dtype=np.int64),
            values,
        )


def configured(engine: Engine, options: Iterable[tuple[str, Any]]) -> Engine:
    """An engine with some of its options set, by the names of their axes; numbers to all their digits.

    Raises:
        DropspinError: There is no such option, or no such value of it.
    """
    chosen = {}
    for name, value in options:
        if not isinstance(value, str | float):
            raise DropspinError(f"got {value!r}; an option is a word or a number.")
        chosen[name.removeprefix(OPTION)] = value if isinstance(value, str) else repr(float(value))
    return type(engine)({**engine.options, **chosen}) if chosen else engine


def _as_json(column: NDArray[Any]) -> list[bytes]:
    if column.dtype == object:
        return [to_json(value) for value in column]
    return to_json(column.tolist())[1:-1].split(b",")

"""Whether two runs have the same motions, bit for bit: the test of determinism across runs, versions and machines."""

from collections.abc import Collection, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from dropspin.comparisons.results.results import Results
from dropspin.scenarios import Trajectory

Digests = Mapping[tuple[str, str, str], str]
"""By scene, engine and time step as text: the hash of the motions that were measured."""
Motion = Literal["same", "different", "unknown"]


def digests_of(stamp: Mapping[str, Any]) -> Digests:
    """The hashes of the motions of a run, from its provenance; empty for runs of versions that recorded none."""
    return flat(stamp.get("motions", {}))


def flat(nested: Mapping[str, Mapping[str, Mapping[str, str]]]) -> Digests:
    """Hashes in mappings of scenes, engines and time steps as one mapping."""
    return {
        (scene, engine, step): digest
        for scene, by_engine in nested.items()
        for engine, by_step in by_engine.items()
        for step, digest in by_step.items()
    }


def compared_digests(row: Mapping[Any, Any], old: Digests, new: Digests) -> Motion:
    """Whether the motions that were measured for a result are equal bit for bit in two runs.

    Args:
        row: The result, with the columns of `values.KEY`.
        old: The hashes of the earlier motions.
        new: Those of the later motions.

    Returns:
        `unknown` where a hash is missing, and for means of ensembles and symmetries, which have other motions.
    """
    pairs = [(old.get(key), new.get(key)) for key in ((row["scene"], row["engine"], step) for step in row["steps"].split(", "))]
    if row["kind"] not in ("truth", "invariant", "order", "asymptotic_error") or any(None in pair for pair in pairs):
        return "unknown"
    return "same" if all(one == other for one, other in pairs) else "different"


def taken_together(rows: pd.DataFrame, old: Digests, new: Digests) -> Motion:
    """Whether the motions of several results are equal: `different` if those of one are."""
    every = {compared_digests(row, old, new) for row in rows.to_dict("records")}
    return "different" if "different" in every else "same" if every == {"same"} else "unknown"


class EqualMotions(NamedTuple):
    """How many motions of one engine are equal bit for bit in two runs.

    Attributes:
        engine: Label of the engine.
        equal: Number of motions that are equal.
        compared: Number of motions that both runs have: one for each scene and time step.
        scene: Scene of the motion whose difference begins earliest in its scene; empty if all are equal. So are the next two.
        dt: Time step of that motion [s]; 0 if all are equal.
        step: The first step after which that motion differs, counted from the start, which is step 0; 0 if all are equal.
    """

    engine: str
    equal: int
    compared: int
    scene: str = ""
    dt: float = 0.0
    step: int = 0


def equal_motions(old: Results, new: Results, left_out: Collection[str] = ()) -> list[EqualMotions]:
    """Compare the motions that two runs have in common, bit for bit.

    Args:
        old: The earlier run, with its trajectories.
        new: The later run, with its trajectories.
        left_out: Scenes that are not compared.

    Returns:
        For each engine that has motions in both runs, how many are equal, and the one that differs first.
    """
    found = []
    for engine in new.engines:
        common = [key for key in new.trajectories if key in old.trajectories and key[1] == engine and key[0] not in left_out]
        steps = {key: _first_difference(old.trajectories[key], new.trajectories[key]) for key in common}
        differing = {key: step for key, step in steps.items() if step is not None}
        if common:
            equal = len(common) - len(differing)
            first = min(differing.items(), key=lambda one: one[1] * one[0][2], default=None)
            found.append(EqualMotions(engine, equal, len(common), *(() if first is None else (first[0][0], first[0][2], first[1]))))
    return found


def _first_difference(old: Trajectory, new: Trajectory) -> int | None:
    """The first row in which two trajectories have different bits; None if there is none. NaN equals NaN of the same bits."""
    rows = min(len(old.t), len(new.t))
    differs = np.zeros(rows, dtype=bool)
    for name in ("position", "orientation", "velocity", "angular_velocity"):
        bits = [np.ascontiguousarray(getattr(one, name)[:rows]).view(np.uint64) for one in (old, new)]
        differs |= (bits[0] != bits[1]).any(axis=1)
    if differs.any():
        return int(differs.argmax())
    return None if len(old.t) == len(new.t) else rows

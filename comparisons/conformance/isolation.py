"""Checks that simulations are independent: of what ran before, of each other, and of the working directory."""

import os
import tempfile
from contextlib import chdir

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.conformance.outcomes import CheckFailed, CheckResult
from dropspin.comparisons.conformance.probes import DT
from dropspin.comparisons.conformance.protocol import SEVERAL
from dropspin.comparisons.conformance.short_runs import A_FEW_STEPS, accepted_scene, advanced, recorded
from dropspin.comparisons.engines.base import Engine

Array = NDArray[np.float64]


def check_repeats(engine: Engine, check: str) -> CheckResult:
    """The same scene gives the same bits after and beside other simulations."""
    a, b = accepted_scene(engine), accepted_scene(engine, "turning", "coasting")
    first, stepped = recorded(engine, a), advanced(engine, a)
    if not all(_same(first, recorded(engine, a)) and _same(stepped, advanced(engine, a)) for _ in range(SEVERAL)):
        raise CheckFailed(
            "the same scene gives different bits when it runs again: the engine is random, or keeps state between simulations"
        )
    with engine.prepare(b, 4 * DT) as other:
        other.advance(A_FEW_STEPS)
        if not _same(first, recorded(engine, a)):
            raise CheckFailed("the same scene gives different bits while another simulation is open: simulations share state")
        if not _same(stepped, advanced(engine, a, lambda: other.advance(A_FEW_STEPS))):
            raise CheckFailed("two simulations that take turns affect each other: simulations share state")
    if not _same(first, recorded(engine, a)):
        raise CheckFailed("the same scene gives different bits after another scene (A, B, A): a simulation leaves state behind")
    return CheckResult(check, "passed", "a scene gives the same bits again and after another scene, and so do two that take turns")


def _same(one: Array, other: Array) -> bool:
    return np.array_equal(one, other, equal_nan=True)


def check_files(engine: Engine, check: str) -> CheckResult:
    """No file is written to the working directory, also when a simulation breaks down."""
    scene = accepted_scene(engine, "tumbling", "turning", "falling straight", "coasting")
    wild = scene.starting_at(scene.initial_state * np.repeat([1.0, 1e4], [7, 6]))
    breakdown = ""
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        recorded(engine, scene)
        if engine.refusal(wild) is None:
            try:
                recorded(engine, wild, 100 * DT)
            except Exception as error:  # a breakdown is allowed, files are not
                breakdown = f"; a start 10,000 times as fast ends in {type(error).__name__}"
        left = sorted(os.listdir(folder))
    if left:
        raise CheckFailed(f"files are left in the working directory: {', '.join(left)}")
    return CheckResult(check, "passed", f"no file is written to the working directory{breakdown}")

"""Which numbers of a body the methods accept, at the limits."""

import math

import numpy as np
import pytest

from dropspin.reference_impl import checks

NUMBERS = np.array([-1.0, -5e-324, 0.0, 5e-324, 1.0, math.inf, math.nan])


@pytest.mark.parametrize(
    ("test", "values", "allowed"),
    [
        (checks.is_above_zero, NUMBERS, [False, False, False, True, True, False, False]),
        (checks.is_not_negative, NUMBERS, [False, False, True, True, True, False, False]),
        (checks.is_finite, NUMBERS.reshape(-1, 1), [True, True, True, True, True, False, False]),
        (checks.are_above_zero, np.array([[1.0, math.inf], [1.0, 0.0], [1.0, -1.0], [0.5, 0.5]]), [True, False, False, True]),
        (checks.is_unit, np.array([[0.6, 0.8], [0.6, 0.8 + 5e-13], [0.6, 0.8 + 7e-13], [0.0, 0.0]]), [True, True, False, False]),
        (
            checks.is_ellipsoid,
            np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 2.0, 3.0], [1.0, -1.0, 1.0]]),
            [True, True, False, False, True, False],
        ),
    ],
)
def test_numbers_are_accepted_up_to_their_limits(test, values, allowed):
    assert test(values).tolist() == allowed


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_inertia_is_symmetric_and_positive_definite_relative_to_its_size(size):
    def matrix(least=1.0, off=0.0, asymmetry=0.0):
        return size * np.array([[4.0, off + asymmetry, 0.0], [off, 3.0, 0.0], [0.0, 0.0, least]])

    accepted = [matrix(), matrix(1e-12), matrix(off=1.0), matrix(off=1.0, asymmetry=3e-12)]
    refused = [matrix(0.0), matrix(1e-13), matrix(-1.0), matrix(off=3.5), matrix(off=1.0, asymmetry=5e-12), matrix(math.nan)]
    assert checks.is_inertia(np.array(accepted + refused)).tolist() == [True] * 4 + [False] * 6


@pytest.mark.parametrize(("largest", "allowed"), [(1e-289, True), (1e-291, False)])
def test_inertia_whose_inverse_is_not_finite_is_refused(largest, allowed):
    assert checks.is_inertia(largest * np.diag([1.0, 0.5, 0.6])[np.newaxis]).tolist() == [allowed]

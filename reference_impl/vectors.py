"""The value types that the equations are written in: `Vec3`, `Quat`, `Mat3`.

Each is a named tuple with operators, so that a kernel line reads as the note prints it: `v + dt * g`,
`R @ I_body @ transpose(R)`. An operator is one plain function: Python calls it as a method, and numba compiles the same
text, so interpreted and compiled arithmetic round alike.
"""

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import njit, types
from numba.extending import overload

compiled = njit(nogil=True, error_model="numpy")
"""Compiles a function of kernel values. IEEE rules (1/0 is inf), no reassociation, and Python's lock is let go."""


def _add3(a: "Vec3", b: "Vec3") -> "Vec3":
    return Vec3(a.x + b.x, a.y + b.y, a.z + b.z)


def _subtract3(a: "Vec3", b: "Vec3") -> "Vec3":
    return Vec3(a.x - b.x, a.y - b.y, a.z - b.z)


def _scale3(scale: float, a: "Vec3") -> "Vec3":
    return Vec3(scale * a.x, scale * a.y, scale * a.z)


def _divide3(a: "Vec3", scale: float) -> "Vec3":
    return Vec3(a.x / scale, a.y / scale, a.z / scale)


def _negate3(a: "Vec3") -> "Vec3":
    return Vec3(-a.x, -a.y, -a.z)


def _add4(a: "Quat", b: "Quat") -> "Quat":
    return Quat(a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w)


def _scale4(scale: float, a: "Quat") -> "Quat":
    return Quat(scale * a.x, scale * a.y, scale * a.z, scale * a.w)


def _divide4(a: "Quat", scale: float) -> "Quat":
    return Quat(a.x / scale, a.y / scale, a.z / scale, a.w / scale)


def _subtract_matrix(a: "Mat3", b: "Mat3") -> "Mat3":
    return Mat3(a.row1 - b.row1, a.row2 - b.row2, a.row3 - b.row3)


def _scale_matrix(scale: float, a: "Mat3") -> "Mat3":
    return Mat3(scale * a.row1, scale * a.row2, scale * a.row3)


def _apply(a: "Mat3", b: "Vec3") -> "Vec3":
    return Vec3(dot(a.row1, b), dot(a.row2, b), dot(a.row3, b))


def _compose(a: "Mat3", b: "Mat3") -> "Mat3":
    columns = transpose(b)
    return transpose(Mat3(a @ columns.row1, a @ columns.row2, a @ columns.row3))


class Vec3(NamedTuple):
    """A vector in three dimensions."""

    x: float
    y: float
    z: float

    # A NumPy scalar on the left must leave the product to __rmul__ instead of turning the vector into an array.
    __array_ufunc__ = None
    __add__ = _add3
    __sub__ = _subtract3
    __truediv__ = _divide3
    __neg__ = _negate3

    def __rmul__(self, scale):
        return _scale3(scale, self)


class Quat(NamedTuple):
    """A quaternion [x, y, z, w], scalar last as in eq 3."""

    x: float
    y: float
    z: float
    w: float

    __array_ufunc__ = None
    __add__ = _add4
    __truediv__ = _divide4

    def __rmul__(self, scale):
        return _scale4(scale, self)


class Mat3(NamedTuple):
    """A 3 x 3 matrix, row by row."""

    row1: Vec3
    row2: Vec3
    row3: Vec3

    __array_ufunc__ = None
    __sub__ = _subtract_matrix

    def __rmul__(self, scale):
        return _scale_matrix(scale, self)

    def __matmul__(self, other):
        return _apply(self, other) if isinstance(other, Vec3) else _compose(self, other)


@compiled
def dot(a, b):
    """a · b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@compiled
def cross(a, b):
    """a × b."""
    return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@compiled
def transpose(m):
    return Mat3(
        Vec3(m.row1.x, m.row2.x, m.row3.x),
        Vec3(m.row1.y, m.row2.y, m.row3.y),
        Vec3(m.row1.z, m.row2.z, m.row3.z),
    )


@compiled
def solve(m, b):
    """The solution j of m j = b, by the adjugate (Cramer's rule)."""
    c1 = cross(m.row2, m.row3)
    c2 = cross(m.row3, m.row1)
    c3 = cross(m.row1, m.row2)
    return (b.x * c1 + b.y * c2 + b.z * c3) / dot(m.row1, c1)


def _is(numba_type: Any, kind: type) -> bool:
    if kind is float:
        return isinstance(numba_type, types.Number)
    return isinstance(numba_type, types.BaseNamedTuple) and numba_type.instance_class is kind


def _teach_numba(symbol: Callable, source: Callable, *kinds: type) -> None:
    """Let compiled code use `source` for `symbol` on operands of these kinds."""
    if len(kinds) == 1:

        @overload(symbol, strict=False)
        def unary(a):
            return source if _is(a, kinds[0]) else None
    else:

        @overload(symbol, strict=False)
        def binary(a, b):
            return source if _is(a, kinds[0]) and _is(b, kinds[1]) else None


for _symbol, _source, *_kinds in (
    (operator.add, _add3, Vec3, Vec3),
    (operator.sub, _subtract3, Vec3, Vec3),
    (operator.mul, _scale3, float, Vec3),
    (operator.truediv, _divide3, Vec3, float),
    (operator.neg, _negate3, Vec3),
    (operator.add, _add4, Quat, Quat),
    (operator.mul, _scale4, float, Quat),
    (operator.truediv, _divide4, Quat, float),
    (operator.sub, _subtract_matrix, Mat3, Mat3),
    (operator.mul, _scale_matrix, float, Mat3),
    (operator.matmul, _apply, Mat3, Vec3),
    (operator.matmul, _compose, Mat3, Mat3),
):
    _teach_numba(_symbol, _source, *_kinds)

"""The value types of the equations: `Vec3`, `Quat`, `Mat3`.

Each is a named tuple with operators, so that a line of a kernel has the form of the lecture note: `v + dt * g`, `R @ I_body @
transpose(R)`. Numba compiles the source of the operator that Python calls, so that interpreted
and compiled arithmetic have the same rounding.
"""

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types
from numba.extending import overload, register_jitable

compiled = register_jitable(forceinline=True)
"""Decorates a function of kernel values: plain Python when called from Python, inlined into the loop of any kernel that calls it.

A call that is not inlined passes the state and the body, about sixty numbers, through memory, which takes half of the time of a step.
"""


def _scale3(scale: float, a: "Vec3") -> "Vec3":
    return Vec3(scale * a.x, scale * a.y, scale * a.z)


def _scale4(scale: float, a: "Quat") -> "Quat":
    return Quat(scale * a.x, scale * a.y, scale * a.z, scale * a.w)


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

    def __add__(self, other):
        return Vec3(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other):
        return Vec3(self.x - other.x, self.y - other.y, self.z - other.z)

    def __rmul__(self, scale):
        return _scale3(scale, self)

    def __truediv__(self, scale):
        return Vec3(self.x / scale, self.y / scale, self.z / scale)

    def __neg__(self):
        return Vec3(-self.x, -self.y, -self.z)


class Quat(NamedTuple):
    """A quaternion [x, y, z, w], scalar last as in eq 3."""

    x: float
    y: float
    z: float
    w: float

    def __add__(self, other):
        return Quat(self.x + other.x, self.y + other.y, self.z + other.z, self.w + other.w)

    def __rmul__(self, scale):
        return _scale4(scale, self)

    def __truediv__(self, scale):
        return Quat(self.x / scale, self.y / scale, self.z / scale, self.w / scale)


class Mat3(NamedTuple):
    """A 3 x 3 matrix, row by row."""

    row1: Vec3
    row2: Vec3
    row3: Vec3

    def __add__(self, other):
        return Mat3(self.row1 + other.row1, self.row2 + other.row2, self.row3 + other.row3)

    def __sub__(self, other):
        return Mat3(self.row1 - other.row1, self.row2 - other.row2, self.row3 - other.row3)

    def __rmul__(self, scale):
        return _scale_matrix(scale, self)

    def __matmul__(self, other):
        return _apply(self, other) if isinstance(other, Vec3) else _compose(self, other)


@compiled
def row(array, i):
    """Row i of an (n, 3) array, as plain floats: NumPy scalars are slow and would take precedence over the operators above."""
    return Vec3(float(array[i, 0]), float(array[i, 1]), float(array[i, 2]))


@compiled
def dot(a, b):
    """A · b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@compiled
def cross(a, b):
    """A × b."""
    return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@compiled
def cross_matrix(r):
    """Eq 14: the matrix r* for which r* j = r × j."""
    return Mat3(Vec3(0.0, -r.z, r.y), Vec3(r.z, 0.0, -r.x), Vec3(-r.y, r.x, 0.0))


@compiled
def transpose(m):
    """The transposed matrix."""
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
    return (1.0 / dot(m.row1, c1)) * (b.x * c1 + b.y * c2 + b.z * c3)


def _is(numba_type: Any, kind: type) -> bool:
    if kind is float:
        return isinstance(numba_type, types.Number)
    return isinstance(numba_type, types.NamedTuple | types.NamedUniTuple) and numba_type.instance_class is kind


def _register_operator(symbol: Callable[..., Any], source: Callable[..., Any], *kinds: type) -> None:
    """Make compiled code use `source` for the operator `symbol` on operands of these kinds."""

    @overload(symbol, strict=False)
    def of_operands(*operands):
        return source if all(map(_is, operands, kinds)) else None


for _symbol, _source, *_kinds in (
    (operator.add, Vec3.__add__, Vec3, Vec3),
    (operator.sub, Vec3.__sub__, Vec3, Vec3),
    (operator.mul, _scale3, float, Vec3),
    (operator.truediv, Vec3.__truediv__, Vec3, float),
    (operator.neg, Vec3.__neg__, Vec3),
    (operator.add, Quat.__add__, Quat, Quat),
    (operator.mul, _scale4, float, Quat),
    (operator.truediv, Quat.__truediv__, Quat, float),
    (operator.add, Mat3.__add__, Mat3, Mat3),
    (operator.sub, Mat3.__sub__, Mat3, Mat3),
    (operator.mul, _scale_matrix, float, Mat3),
    (operator.matmul, _apply, Mat3, Vec3),
    (operator.matmul, _compose, Mat3, Mat3),
):
    _register_operator(_symbol, _source, *_kinds)

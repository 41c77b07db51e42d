"""SIMD lanes: `WIDTH` bodies in one processor register, for the ensemble kernel.

`Lanes` is a number to numba and a vector of doubles to LLVM. The kernels, written for one number, compile for it unchanged. Each operation
is the IEEE operation in each lane, so the motion of a body in an ensemble is bit for bit that of a single body. Nothing in this module runs
in plain Python.

It is longer than other modules because numba must be given each operator, function and memory access of the new type.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.core.typeconv.castgraph import Conversion
from numba.core.typeconv.rules import default_type_manager
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, overload, overload_attribute, register_model
from numpy.typing import NDArray

from dropspin.reference_impl.vectors import NumberLike, Vec3, any_, compiled, select

Array = NDArray[np.float64]

FEATURES = cpu_target.target_context.codegen().magic_tuple()[2].split(",")  # of the processor that numba compiles for
WIDTH = 16 if "+avx512f" in FEATURES else 8 if "+avx" in FEATURES else 4
"""Two registers, so that one operation can start while another is in progress."""


class LanesType(NumberLike):
    """A float64 for each of `WIDTH` bodies."""

    def __init__(self) -> None:
        super().__init__("lanes")

    def unify(self, typingctx: Any, other: types.Type) -> types.Type | None:
        return self if isinstance(other, types.Float | types.Integer) else None

    def can_convert_from(self, typingctx: Any, other: types.Type) -> Conversion | None:
        return Conversion.safe if isinstance(other, types.Float | types.Integer) else None


class MaskType(types.Type):
    """A truth value for each of `WIDTH` bodies."""

    def __init__(self) -> None:
        super().__init__("mask")

    def unify(self, typingctx: Any, other: types.Type) -> types.Type | None:
        return self if isinstance(other, types.Boolean) else None

    def can_convert_from(self, typingctx: Any, other: types.Type) -> Conversion | None:
        return Conversion.safe if isinstance(other, types.Boolean) else None


class LaneRowsType(types.Type):
    """Rows of lanes in memory, shape (n, 3): the vertices of `WIDTH` bodies."""

    def __init__(self) -> None:
        super().__init__("lane_rows")


LANES, MASK, LANE_ROWS = LanesType(), MaskType(), LaneRowsType()
VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
BITS = ir.VectorType(ir.IntType(1), WIDTH)


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, numba_type: types.Type) -> None:
        super().__init__(manager, numba_type, VECTOR)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, numba_type: types.Type) -> None:
        super().__init__(manager, numba_type, BITS)


@register_model(LaneRowsType)
class _LaneRowsModel(models.StructModel):
    def __init__(self, manager: Any, numba_type: types.Type) -> None:
        super().__init__(manager, numba_type, [("data", types.CPointer(types.float64)), ("count", types.intp)])


# Conversion of numbers to lanes: a constant applies to every body.


def _splat(builder: ir.IRBuilder, value: ir.Value, vector: ir.VectorType) -> ir.Value:
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(one, ir.Constant(vector, ir.Undefined), everywhere)


@lower_cast(types.Float, LanesType)
@lower_cast(types.Integer, LanesType)
def _number_to_lanes(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _splat(builder, context.cast(builder, value, source, types.float64), VECTOR)


@lower_cast(types.Boolean, MaskType)
def _boolean_to_mask(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _splat(builder, context.cast(builder, value, source, types.boolean), BITS)


VECTOR_OF_NUMBERS, VECTOR_OF_LANES = (types.NamedUniTuple(number, 3, Vec3) for number in (types.float64, LANES))
default_type_manager.set_compatible(VECTOR_OF_NUMBERS, VECTOR_OF_LANES, Conversion.safe)


@lower_cast(VECTOR_OF_NUMBERS, VECTOR_OF_LANES)
def _vector_to_lanes(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return context.make_tuple(builder, target, [_splat(builder, component, VECTOR) for component in cgutils.unpack_tuple(builder, value)])


# Operators, of one instruction each.


def _register_operator(symbol: Callable[..., Any], operands: int, operand: Any, result: Any, build: Callable[..., ir.Value]) -> None:
    """Make compiled code accept the operator `symbol` on lanes or masks, mixed with numbers."""

    class Template(AbstractTemplate):
        def generic(self, arguments: tuple[types.Type, ...], keywords: dict[str, types.Type]) -> Any:
            if len(arguments) == operands and operand in arguments:
                return signature(result, *[operand] * operands)
            return None

    infer_global(symbol)(Template)

    @lower_builtin(symbol, *[type(operand)] * operands)
    def lower(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return build(builder, *arguments)


def _comparison(sign: str) -> Callable[..., ir.Value]:
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


_register_operator(operator.add, 2, LANES, LANES, lambda builder, a, b: builder.fadd(a, b))
_register_operator(operator.sub, 2, LANES, LANES, lambda builder, a, b: builder.fsub(a, b))
_register_operator(operator.mul, 2, LANES, LANES, lambda builder, a, b: builder.fmul(a, b))
_register_operator(operator.truediv, 2, LANES, LANES, lambda builder, a, b: builder.fdiv(a, b))
_register_operator(operator.neg, 1, LANES, LANES, lambda builder, a: builder.fneg(a))
_register_operator(operator.lt, 2, LANES, MASK, _comparison("<"))
_register_operator(operator.le, 2, LANES, MASK, _comparison("<="))
_register_operator(operator.gt, 2, LANES, MASK, _comparison(">"))
_register_operator(operator.ge, 2, LANES, MASK, _comparison(">="))
_register_operator(operator.eq, 2, LANES, MASK, _comparison("=="))
_register_operator(operator.and_, 2, MASK, MASK, lambda builder, a, b: builder.and_(a, b))
_register_operator(operator.or_, 2, MASK, MASK, lambda builder, a, b: builder.or_(a, b))


# Functions.


@intrinsic
def _select(typingctx: Any, mask: Any, a: Any, b: Any) -> Any:
    def build(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return builder.select(*arguments)

    return LANES(MASK, LANES, LANES), build


@overload(select)
def _select_lanes(mask, a, b):
    if mask is MASK and isinstance(a, types.Number | NumberLike):
        return lambda mask, a, b: _select(mask, a, b)
    return None


@overload(any_)
def _any_lanes(mask):
    return (lambda mask: _any(mask)) if mask is MASK else None


@intrinsic
def _any(typingctx: Any, mask: Any) -> Any:
    def build(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        bits = builder.bitcast(arguments[0], ir.IntType(WIDTH))
        return builder.icmp_unsigned("!=", bits, bits.type(0))

    return types.boolean(MASK), build


def _register_function(symbol: Callable[..., Any], name: str) -> None:
    """Make compiled code call LLVM's function of that name; sine and cosine become one call of the C library for each lane."""

    @intrinsic
    def call(typingctx: Any, a: Any) -> Any:
        def build(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
            function_type = ir.FunctionType(VECTOR, [VECTOR])
            function = cgutils.get_or_insert_function(builder.module, function_type, f"{name}.v{WIDTH}f64")
            return builder.call(function, arguments)

        return LANES(LANES), build

    @overload(symbol)
    def on_lanes(a):
        return (lambda a: call(a)) if a is LANES else None


_register_function(math.sqrt, "llvm.sqrt")
_register_function(math.sin, "llvm.sin")
_register_function(math.cos, "llvm.cos")
_register_function(abs, "llvm.fabs")


@overload(max)
def _max_lanes(a, b):
    return (lambda a, b: select(b > a, b, a)) if LANES in (a, b) else None


@overload(min)
def _min_lanes(a, b):
    return (lambda a, b: select(b < a, b, a)) if LANES in (a, b) else None


@overload(float)
def _float_lanes(a):
    return (lambda a: a) if a is LANES else None


# Memory. A block of an array holds `WIDTH` bodies side by side, column by column: shape (blocks, columns * WIDTH).


def side_by_side(array: Array) -> Array:
    """Rows of bodies, shape (B, …, k), as blocks of lanes, shape (blocks, …, k * WIDTH); copies of the last body fill the last block."""
    blocks = -(-len(array) // WIDTH)
    filled = array if blocks * WIDTH == len(array) else array[np.minimum(np.arange(blocks * WIDTH), len(array) - 1)]
    lanes_last = filled.reshape(blocks, WIDTH, *array.shape[1:]).transpose(0, *range(2, array.ndim + 1), 1)
    return lanes_last.reshape(blocks, *array.shape[1:-1], -1)


@compiled
def load(array, block, column):
    """A column of a block, array of shape (blocks, columns * WIDTH)."""
    return _load(array, block * array.shape[1] + column * WIDTH)


@compiled
def rows_of(array, block):
    """The rows of a block, array of shape (blocks, n, 3 * WIDTH), as `vectors.row` reads them."""
    return _rows_of(array, min(block, array.shape[0] - 1) * array.shape[1] * array.shape[2], array.shape[1])


@compiled
def record(recorded, block, row, x, q, v, w):
    """Write the states of the bodies of a block to `recorded`, shape (B, n, 13); B need not be a multiple of the width."""
    bodies = min(WIDTH, recorded.shape[0] - block * WIDTH)
    first = (block * WIDTH * recorded.shape[1] + row) * 13
    _scatter(recorded, first, recorded.shape[1] * 13, bodies, (x.x, x.y, x.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z))


def _address(context: Any, builder: Any, array_type: Any, array: Any, offset: Any) -> Any:
    data = cgutils.create_struct_proxy(array_type)(context, builder, array).data
    return builder.gep(data, [offset])


@intrinsic
def _load(typingctx: Any, array: Any, offset: Any) -> Any:
    def build(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        address = _address(context, builder, sig.args[0], *arguments)
        return builder.load(builder.bitcast(address, VECTOR.as_pointer()), align=8, typ=VECTOR)

    return LANES(array, types.intp), build


@intrinsic
def _scatter(typingctx: Any, array: Any, first: Any, stride: Any, bodies: Any, values: Any) -> Any:
    def build(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        array, first, stride, bodies, values = arguments
        for lane in range(WIDTH):
            with builder.if_then(builder.icmp_signed(">", bodies, bodies.type(lane)), likely=True):
                offset = builder.add(first, builder.mul(stride, stride.type(lane)))
                for place in range(sig.args[4].count):
                    number = builder.extract_element(builder.extract_value(values, place), ir.Constant(ir.IntType(32), lane))
                    target = builder.add(offset, offset.type(place))
                    builder.store(number, _address(context, builder, sig.args[0], array, target))
        return context.get_dummy_value()

    return types.none(array, types.intp, types.intp, types.intp, values), build


@intrinsic
def _rows_of(typingctx: Any, array: Any, offset: Any, count: Any) -> Any:
    def build(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        rows = cgutils.create_struct_proxy(LANE_ROWS)(context, builder)
        rows.data = _address(context, builder, sig.args[0], *arguments[:2])
        rows.count = arguments[2]
        return rows._getvalue()

    return LANE_ROWS(array, types.intp, types.intp), build


@intrinsic
def _row_count(typingctx: Any, rows: Any) -> Any:
    def build(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return cgutils.create_struct_proxy(LANE_ROWS)(context, builder, arguments[0]).count

    return types.intp(LANE_ROWS), build


@intrinsic
def _row_component(typingctx: Any, rows: Any, place: Any) -> Any:
    def build(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        data = cgutils.create_struct_proxy(LANE_ROWS)(context, builder, arguments[0]).data
        address = builder.gep(data, [arguments[1]])
        return builder.load(builder.bitcast(address, VECTOR.as_pointer()), align=8, typ=VECTOR)

    return LANES(LANE_ROWS, types.intp), build


@overload_attribute(LaneRowsType, "shape")
def _shape_of_rows(rows):
    return lambda rows: (_row_count(rows), 3)


@overload(operator.getitem)
def _component_of_rows(rows, place):
    if rows is LANE_ROWS:
        return lambda rows, place: _row_component(rows, (place[0] * 3 + place[1]) * WIDTH)
    return None

"""The innermost loops of the compiled step, told to the compiler in vectors of LANES numbers.

Sums run over all modes while the modes are stepped. As a plain loop, the compiler would have to prove that the modes
written do not overlap what is read of them, which it cannot: it then keeps the sums in memory, or takes narrow vectors.
Lanes are modes for one turbine, and turbines for a batch. Arrays begin at multiples of ALIGNMENT.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from flapgym.core.arrays import BLADES
from flapgym.plant.layout import (
    ALIGNMENT,
    DRIVE,
    LANES,
    PUSH_ROWS,
    READ,
    READ_ROWS,
    STEP_INPUTS,
    STEP_ROWS,
    VALUE,
)

FLAGS = ("reassoc", "contract", "nsz")
"""As of every loop: sums may be reordered and products fused."""
NEXT_TO_NOTHING = 1e-30
"""Of a mode, whose loads are of the order of its numbers times 1e6."""
PARTS = 2
"""Real and imaginary part."""


class _Vectors:
    """Arithmetic with vectors while a function is being made; rows of LANES numbers lie one behind the other."""

    def __init__(self, context: Any, builder: Any, kind: Any) -> None:
        self.context, self.builder, self.kind = context, builder, kind
        self.number, self.index = context.get_value_type(kind), context.get_value_type(types.intp)
        self.type = ir.VectorType(self.number, LANES)

    def start(self, array_type: Any, array: Any) -> Any:
        """Where an array begins."""
        return self.context.make_array(array_type)(self.context, self.builder, array).data

    def whole(self, number: int) -> Any:
        """A whole number."""
        return ir.Constant(self.index, number)

    def place(self, start: Any, first: Any, rows: int | Any, row: int = 0) -> Any:
        """Where row `row` behind `first` times so many rows is."""
        rows = self.whole(rows) if isinstance(rows, int) else rows
        skipped = self.builder.add(self.builder.mul(first, rows), self.whole(row))
        number = self.builder.mul(skipped, self.whole(LANES))
        return self.builder.bitcast(self.builder.gep(start, [number]), self.type.as_pointer())

    def load(self, place: Any) -> Any:
        """A row."""
        return self.builder.load(place, align=ALIGNMENT)

    def store(self, vector: Any, place: Any) -> None:
        """Write a row."""
        self.builder.store(vector, place, align=ALIGNMENT)

    def number_at(self, start: Any, place: Any, further: int = 0) -> Any:
        """One number of an array, in every lane."""
        return self.everywhere(
            self.builder.load(self.builder.gep(start, [self.builder.add(place, self.whole(further))]))
        )

    def everywhere(self, number: Any) -> Any:
        """A number in every lane."""
        nothing, first = ir.Constant(self.type, ir.Undefined), ir.Constant(ir.IntType(32), 0)
        alone = self.builder.insert_element(nothing, number, first)
        mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return self.builder.shuffle_vector(alone, nothing, mask)

    def variable(self, begin: Any = None) -> Any:
        """A vector that changes in a loop, at first zero."""
        place = cgutils.alloca_once(self.builder, self.type)
        self.builder.store(ir.Constant(self.type, [0.0] * LANES) if begin is None else begin, place)
        return place

    def sum(self, products: Iterable[tuple[Any, Any]], onto: Any = None) -> Any:
        """Sum of products, and of what is there already."""
        for one, two in products:
            product = self.builder.fmul(one, two, flags=FLAGS)
            onto = product if onto is None else self.builder.fadd(onto, product, flags=FLAGS)
        return onto

    def times(self, value: Sequence[Any], mode: Sequence[Any]) -> list[Any]:
        """Product of complex numbers."""
        (a, b), (re, im) = value, mode
        real = self.builder.fsub(self.sum([(a, re)]), self.sum([(b, im)]), flags=FLAGS)
        return [real, self.sum([(b, re), (a, im)])]

    def driven(self, mode: Sequence[Any], drives: Sequence[Any], inputs: Sequence[Any]) -> list[Any]:
        """A mode under inputs; drives to the real part come before those to the imaginary one."""
        return [
            self.sum(zip(drives[part * len(inputs) :], inputs, strict=False), onto=mode[part])
            for part in range(PARTS)
        ]

    def flushed(self, vector: Any) -> Any:
        """Zero where a number is next to nothing; NaN passes.

        What flaps at rest leave in the modes would decay to denormal numbers, which make a step ten times as long.
        """
        least, most = (
            self.everywhere(ir.Constant(self.number, sign * NEXT_TO_NOTHING)) for sign in (-1.0, 1.0)
        )
        inside = self.builder.and_(
            self.builder.fcmp_ordered(">", vector, least), self.builder.fcmp_ordered("<", vector, most)
        )
        return self.builder.select(inside, ir.Constant(self.type, [0.0] * LANES), vector)

    def total(self, vector: Any) -> Any:
        """Sum over the lanes."""
        name = f"llvm.vector.reduce.fadd.v{LANES}f{self.kind.bitwidth}"
        signature = ir.FunctionType(self.number, [self.number, self.type])
        function = cgutils.get_or_insert_function(self.builder.module, signature, name)
        return self.builder.call(function, [ir.Constant(self.number, -0.0), vector], fastmath=FLAGS)


def _decay_and_read(kind: Any, pushed: bool) -> Callable[..., Any]:
    """What makes the code of the two functions below."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        v = _Vectors(context, builder, kind)
        starts = [v.start(signature.args[i], arguments[i]) for i in ((0, 1, 3) if pushed else (0, 1))]
        accelerations = [v.everywhere(number) for number in arguments[4:]]
        sums = [v.variable() for _ in range(BLADES)]
        with cgutils.for_range(builder, arguments[2]) as groups:
            constants = [v.load(v.place(starts[0], groups.index, READ_ROWS, row)) for row in range(READ_ROWS)]
            places = [v.place(starts[1], groups.index, PARTS, part) for part in range(PARTS)]
            mode = v.times(constants[VALUE:READ], [v.load(place) for place in places])
            if pushed:
                rows = range(DRIVE, PUSH_ROWS)
                drives = [v.load(v.place(starts[2], groups.index, PUSH_ROWS, row)) for row in rows]
                mode = [v.flushed(part) for part in v.driven(mode, drives, accelerations)]
            for part, place in zip(mode, places, strict=True):
                v.store(part, place)
            for output, total in enumerate(sums):
                shares = zip(constants[READ + PARTS * output :], mode, strict=False)
                builder.store(v.sum(shares, onto=builder.load(total)), total)
        read = [v.total(builder.load(total)) for total in sums]
        return context.make_tuple(builder, signature.return_type, read)

    return generate


@intrinsic
def decay_and_read(typingctx, constants, modes, groups):  # type: ignore[no-untyped-def]
    """Step the modes of one turbine, without inputs, and read its three moments.

    Parameters
    ----------
    constants : (groups READ_ROWS LANES,) float
        Rows of each group of modes: eigenvalue, then real and imaginary part in turn to each moment.
    modes : (groups 2 LANES,) float
        Real parts of each group, then imaginary ones; overwritten.
    groups : int

    Returns
    -------
    three of the same precision
    """
    kind = constants.dtype
    return types.UniTuple(kind, BLADES)(constants, modes, groups), _decay_and_read(kind, False)


@intrinsic
def decay_push_and_read(typingctx, constants, modes, groups, push, one, two, three):  # type: ignore[no-untyped-def]
    """The same with what three held accelerations have done to the modes.

    Parameters
    ----------
    push : (groups PUSH_ROWS LANES,) float
        Rows of each group: eigenvalue, which is not used, accelerations to the real and to the imaginary part.
    one, two, three : float
        The accelerations.
    """
    kind = constants.dtype
    signature = types.UniTuple(kind, BLADES)(constants, modes, groups, push, kind, kind, kind)
    return signature, _decay_and_read(kind, True)


@intrinsic
def add_deviations(typingctx, constants, modes, groups, deviations, first, last):  # type: ignore[no-untyped-def]
    """Add to the modes of one turbine what the flaps' deviations from a held acceleration have done by the last sample.

    Parameters
    ----------
    constants : (groups STEP_ROWS LANES,) float
        Rows of each group: eigenvalue, acceleration and jump of a step to the real and to the imaginary part.
    modes : (groups 2 LANES,) float
    groups : int
    deviations : (last 6,) float
        Of acceleration and angle in every step.
    first, last : int
        The first step with a deviation, counted from 1, and the last one.
    """
    kind = constants.dtype

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        v = _Vectors(context, builder, kind)
        constant, modes, deviations = (v.start(signature.args[i], arguments[i]) for i in (0, 1, 3))
        with cgutils.for_range(builder, arguments[2]) as groups:

            def row(number: int) -> Any:
                return v.load(v.place(constant, groups.index, STEP_ROWS, number))

            def by(first: int, numbers: Sequence[Any], mode: Sequence[Any]) -> list[Any]:
                vectors = [v.everywhere(number) for number in numbers]
                rows = [
                    row(DRIVE + STEP_INPUTS * part + first + i)
                    for part in range(PARTS)
                    for i in range(BLADES)
                ]
                return v.driven(mode, rows, vectors)

            value = [row(VALUE + part) for part in range(PARTS)]
            done = [v.variable() for _ in range(PARTS)]
            begin = builder.sub(arguments[4], v.whole(1))
            with cgutils.for_range(builder, arguments[5], start=begin) as steps:
                at = builder.mul(steps.index, v.whole(STEP_INPUTS))
                size = [
                    builder.load(builder.gep(deviations, [builder.add(at, v.whole(component))]))
                    for component in range(STEP_INPUTS)
                ]
                mode = v.times(value, [builder.load(part) for part in done])
                for part, after in zip(done, by(0, size[:BLADES], mode), strict=True):
                    builder.store(after, part)
                # A flap that meets a stop jumps once, and is off for the rest of the interval.
                nothing = ir.Constant(v.number, 0.0)
                jumps = [builder.fcmp_unordered("!=", each, nothing) for each in size[BLADES:]]
                with builder.if_then(builder.or_(builder.or_(jumps[0], jumps[1]), jumps[2]), likely=False):
                    mode = [builder.load(part) for part in done]
                    for part, after in zip(done, by(BLADES, size[BLADES:], mode), strict=True):
                        builder.store(after, part)
            for part in range(PARTS):
                place = v.place(modes, groups.index, PARTS, part)
                v.store(builder.fadd(v.load(place), builder.load(done[part]), flags=FLAGS), place)
        return context.get_dummy_value()

    return types.void(constants, modes, types.intp, deviations, types.intp, types.intp), generate


@intrinsic
def add_columns(typingctx, columns, stride, vector, count, blocks, outputs):  # type: ignore[no-untyped-def]
    """Add columns of a matrix times numbers to the outputs of one turbine.

    Parameters
    ----------
    columns : (count stride,) float
    stride : int
        Numbers of a column, a multiple of LANES.
    vector : (count,) float
    count : int
    blocks : int
        Of LANES outputs that are wanted.
    outputs : (LANES blocks,) float
    """
    kind = columns.dtype

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        v = _Vectors(context, builder, kind)
        columns, vector, outputs = (v.start(signature.args[i], arguments[i]) for i in (0, 2, 5))
        rows = builder.sdiv(arguments[1], v.whole(LANES))
        with cgutils.for_range(builder, arguments[4]) as blocks:
            place = v.place(outputs, blocks.index, 1)
            total = v.variable(v.load(place))
            with cgutils.for_range(builder, arguments[3]) as each:
                block = builder.add(builder.mul(each.index, rows), blocks.index)
                column, number = v.load(v.place(columns, block, 1)), v.number_at(vector, each.index)
                builder.store(v.sum([(column, number)], builder.load(total)), total)
            v.store(builder.load(total), place)
        return context.get_dummy_value()

    signature = types.void(columns, types.intp, vector, types.intp, types.intp, outputs)
    return signature, generate


@intrinsic
def add_products_of_block(typingctx, matrix, stride, rows, vectors, pairs, outputs):  # type: ignore[no-untyped-def]
    """Add a matrix times vectors to the outputs of LANES turbines side by side.

    Parameters
    ----------
    matrix : (rows stride,) float
        Of which the first 2 pairs columns are used.
    stride, rows : int
        Rows are a multiple of three: three at a time share what is read of the vectors.
    vectors : (2 pairs LANES,) float
    pairs : int
    outputs : (rows LANES,) float
    """
    kind = matrix.dtype

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        v = _Vectors(context, builder, kind)
        numbers, vectors, outputs = (v.start(signature.args[i], arguments[i]) for i in (0, 3, 5))
        stride, rows, pairs = arguments[1], arguments[2], arguments[4]
        with cgutils.for_range(builder, builder.sdiv(rows, v.whole(3))) as triples:
            # Two sums a row: enough that no multiply-add waits for the one before.
            places = [v.place(outputs, triples.index, 3, row) for row in range(3)]
            sums = [[v.variable(v.load(place)), v.variable()] for place in places]
            first = builder.mul(builder.mul(triples.index, v.whole(3)), stride)
            starts = [builder.add(first, builder.mul(v.whole(row), stride)) for row in range(3)]
            with cgutils.for_range(builder, pairs) as columns:
                at = builder.mul(columns.index, v.whole(PARTS))
                pair = [v.load(v.place(vectors, columns.index, PARTS, part)) for part in range(PARTS)]
                for start, row in zip(starts, sums, strict=True):
                    for part in range(PARTS):
                        factor = v.number_at(numbers, builder.add(start, at), part)
                        builder.store(v.sum([(factor, pair[part])], builder.load(row[part])), row[part])
            for (one, two), place in zip(sums, places, strict=True):
                v.store(builder.fadd(builder.load(one), builder.load(two), flags=FLAGS), place)
        return context.get_dummy_value()

    signature = types.void(matrix, types.intp, types.intp, vectors, types.intp, outputs)
    return signature, generate


@intrinsic
def push_block(typingctx, decay, push, stride, modes, pairs, inputs, count):  # type: ignore[no-untyped-def]
    """Modes of LANES turbines at the end of an interval under what its steps add.

    Parameters
    ----------
    decay : (4 pairs,) float
        What an interval leaves of each mode, real and imaginary part in turn.
    push : (4 pairs stride,) float
        Accelerations of all steps, then jumps, to real and imaginary part of each mode in turn.
    stride : int
    modes : (4 pairs LANES,) float
        Real and imaginary part of each mode in turn; overwritten.
    pairs : int
        Of modes: two at a time share what is read of the inputs.
    inputs : (count LANES,) float
    count : int
        Of the inputs that are not zero.
    """
    kind = decay.dtype

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        v = _Vectors(context, builder, kind)
        decay, push, modes, inputs = (v.start(signature.args[i], arguments[i]) for i in (0, 1, 3, 5))
        stride, quad = arguments[2], 2 * PARTS
        with cgutils.for_range(builder, arguments[4]) as pairs:
            at = builder.mul(pairs.index, v.whole(quad))
            values = [v.number_at(decay, at, row) for row in range(quad)]
            places = [v.place(modes, pairs.index, quad, row) for row in range(quad)]
            before = [v.load(place) for place in places]
            left = v.times(values[:PARTS], before[:PARTS]) + v.times(values[PARTS:], before[PARTS:])
            sums = [v.variable(part) for part in left]
            starts = [builder.mul(builder.add(at, v.whole(row)), stride) for row in range(quad)]
            with cgutils.for_range(builder, arguments[6]) as columns:
                given = v.load(v.place(inputs, columns.index, 1))
                for start, total in zip(starts, sums, strict=True):
                    factor = v.number_at(push, builder.add(start, columns.index))
                    builder.store(v.sum([(factor, given)], builder.load(total)), total)
            for total, place in zip(sums, places, strict=True):
                v.store(v.flushed(builder.load(total)), place)
        return context.get_dummy_value()

    return types.void(decay, push, types.intp, modes, types.intp, inputs, types.intp), generate

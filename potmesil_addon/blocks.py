"""Square blocks of samples that spread as one, where neighbours are alike and their circles are large.

Twice the circle of confusion has twice the rows, and so takes a scatter twice the time. But the larger the
circle, the less it matters where under it the light of a few neighbours comes from: an even block spread
through the mean of its samples' tables (`aperture.widened`) gives the very picture that they give one by
one, and an uneven one differs by its contrast, over a part of a pixel, thinned by the circle's area. With
blocks that grow with the circles, time hardly grows.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from . import jit
from .lens import FloatArray
from .psf import PsfBuilder, TableAssignment, renumber, tables_used
from .samples import Float32Array
from .scatter import NO_MARKS, Marks

_LEVELS: Final = 4
"""How often four blocks become one: the largest have sides of 16 samples."""

_LEAST_CIRCLE: Final = 8.0
"""Diameter of a circle, in sides of the block, from which its samples may spread as one."""

_MOST_STEP: Final = 1.0 / 32.0
"""Most that the diameters of a block's circles differ, as a share of one."""

_MOST_CONTRAST: Final = 1.0 / 16.0
"""Most that a block's samples differ, as a share of their brightest channel, for each side in a diameter."""

_LEAST_SHARE: Final = 0.2
"""Least share of a quarter of a block in its weight."""

_TABLES_PER_E: Final = 128.0
"""Tables of blocks while the diameter grows e times: each circle is within 0.4 % of its table's."""


def put_in_blocks(
    color: Float32Array,
    weight: Float32Array,
    assignment: TableAssignment,
    builder: PsfBuilder,
    *,
    brightest: float = math.inf,
    least_alpha: float = 0.0,
    marks: Marks | None = None,
    compiled: bool,
) -> tuple[TableAssignment, npt.NDArray[np.int64]]:
    """Put samples that are alike into blocks, in place.

    Four neighbours become one where their circles are large and nearly the same, and their colours alike;
    four of these may become one again. What is left of a block is its upper left sample, with the mean of
    the colours and the sum of the weights. The others weigh nothing.

    Parameters
    ----------
    color : ndarray of float32 of shape (sheets, rows, columns, 4)
        Premultiplied.
    weight : ndarray of float32 of shape (sheets, rows, columns)
        Weights, 0 or more.
    assignment : TableAssignment
        The table of each sample, (sheets, rows, columns); stays as it is.
    builder : PsfBuilder
        Makes the tables; its settings say whether there are to be blocks.
    brightest : float, optional
        Light, on average over red, green and blue, past which samples stay single.
    least_alpha : float, optional
        Alpha below which they do.
    marks : tuple of two ndarrays of float32 of shape (sheets, rows, columns), optional
        Two more numbers of each sample, in which the samples of a block need not be alike.
    compiled : bool
        Whether to take the compiled kernel or numpy; both give the same.

    Returns
    -------
    assignment : TableAssignment
        The tables of blocks and of single samples.
    side : ndarray of int64 of shape (tables,)
        Side of the block that each table is for, 1 for single samples.
    """
    if not builder.settings.uses_blocks:
        return assignment, np.ones(assignment.circles.size, dtype=np.int64)
    pitch = builder.film.pitch_x
    circle, table = assignment.circles / pitch, assignment.table.copy()
    lowest, of_blocks = _circles_of_blocks(circle)
    circles = np.concatenate([circle, *[of_blocks] * _LEVELS])
    begin = circle.size + np.arange(_LEVELS) * of_blocks.size
    put = _put_together if compiled else _put_together_numpy
    mark = NO_MARKS if marks is None else marks
    put(color, weight, table, *mark, marks is not None, brightest, least_alpha, circles, begin, lowest)
    is_used = tables_used(table, circles.size)
    used = np.flatnonzero(is_used)
    side = 1 << np.searchsorted(begin, used, side="right")
    renumber(table, is_used)
    return TableAssignment(circles[used] * pitch, table, None), side


def _circles_of_blocks(circle: FloatArray) -> tuple[int, FloatArray]:
    """Return diameters at equal ratios, the same ones frame after frame, and the number of the first."""
    lowest, highest = (
        math.copysign(_TABLES_PER_E * math.log(max(abs(most), 1.0)), most)
        for most in (circle.min(), circle.max())
    )
    numbers = np.arange(np.rint(lowest), np.rint(highest) + 1.0)
    return int(numbers[0]), np.sign(numbers) * np.exp(np.abs(numbers) / _TABLES_PER_E)


@jit.kernel(parallel=True)
def _put_together(
    color: Any, weight: Any, table: Any, mark_1: Any, mark_2: Any,
    marked: bool, brightest: float, least_alpha: float, circles: Any, begin: Any, lowest: int,
) -> None:  # fmt: skip
    """Make blocks of samples in place, the smallest first."""
    sheets, rows, columns = weight.shape
    largest = 1 << _LEVELS
    strips = (rows + largest - 1) // largest
    for strip in jit.prange(sheets * strips):
        s: Any = np.int64(strip)
        # A thread takes numbers that follow each other: each gets strips of all sheets.
        sheet, top = s % sheets, s // sheets * largest
        bottom = min(top + largest, rows)
        c, w, t = color[sheet], weight[sheet], table[sheet]
        for level in range(1, _LEVELS + 1):
            h = 1 << (level - 1)
            side = 2 * h
            below = 0 if level == 1 else begin[level - 2]
            for y in range(top, bottom - side + 1, side):
                for x in range(0, columns - side + 1, side):
                    t0, t1, t2, t3 = t[y, x], t[y, x + h], t[y + h, x], t[y + h, x + h]
                    if min(t0, t1, t2, t3) < below or abs(circles[t0]) < _LEAST_CIRCLE * side:
                        continue
                    c0, c1, c2, c3 = circles[t0], circles[t1], circles[t2], circles[t3]
                    if max(c0, c1, c2, c3) - min(c0, c1, c2, c3) > _MOST_STEP * abs(c0):
                        continue
                    w0, w1, w2, w3 = w[y, x], w[y, x + h], w[y + h, x], w[y + h, x + h]
                    sum_w = (w0 + w1) + (w2 + w3)
                    if not min(w0, w1, w2, w3) > _LEAST_SHARE * sum_w:
                        continue
                    # Colours against the brightest of them, alpha against 1.
                    contrast, most, light = np.float32(0.0), np.float32(0.0), 0.0
                    for i in range(3):
                        i0, i1, i2, i3 = c[y, x, i], c[y, x + h, i], c[y + h, x, i], c[y + h, x + h, i]
                        contrast = max(contrast, max(i0, i1, i2, i3) - min(i0, i1, i2, i3))
                        most = max(most, (i0 + i1) + (i2 + i3))
                        light += (i0 + i1) + (i2 + i3)
                    i0, i1, i2, i3 = c[y, x, 3], c[y, x + h, 3], c[y + h, x, 3], c[y + h, x + h, 3]
                    allowed = _MOST_CONTRAST * abs(c0) / side
                    if contrast > allowed * 0.25 * most or light > 12.0 * brightest:
                        continue
                    if max(i0, i1, i2, i3) - min(i0, i1, i2, i3) > allowed or i0 < least_alpha:
                        continue
                    for i in range(4):
                        first = c[y, x, i] * w0 + c[y, x + h, i] * w1
                        c[y, x, i] = (first + (c[y + h, x, i] * w2 + c[y + h, x + h, i] * w3)) / sum_w
                    if marked:
                        m, n = mark_1[sheet], mark_2[sheet]
                        first = m[y, x] * w0 + m[y, x + h] * w1
                        second = n[y, x] * w0 + n[y, x + h] * w1
                        m[y, x] = (first + (m[y + h, x] * w2 + m[y + h, x + h] * w3)) / sum_w
                        n[y, x] = (second + (n[y + h, x] * w2 + n[y + h, x + h] * w3)) / sum_w
                    w[y, x], w[y, x + h], w[y + h, x], w[y + h, x + h] = sum_w, 0.0, 0.0, 0.0
                    mean = ((c0 + c1) + (c2 + c3)) * 0.25
                    of_mean = math.copysign(np.rint(_TABLES_PER_E * math.log(abs(mean))), mean)
                    chosen = begin[level - 1] + int(of_mean) - lowest
                    t[y, x], t[y, x + h], t[y + h, x], t[y + h, x + h] = chosen, chosen, chosen, chosen


def _put_together_numpy(
    color: Float32Array, weight: Float32Array, table: npt.NDArray[np.int32],
    mark_1: Float32Array, mark_2: Float32Array,
    marked: bool, brightest: float, least_alpha: float,
    circles: FloatArray, begin: npt.NDArray[np.int64], lowest: int,
) -> None:  # fmt: skip
    """Do the same for all blocks of a level at once."""
    for level in range(1, _LEVELS + 1):
        h = 1 << (level - 1)
        side = 2 * h
        rows, columns = (size - size % side for size in weight.shape[1:])
        at = [np.s_[:, y:rows:side, x:columns:side] for y in (0, h) for x in (0, h)]
        t, w, c = [table[a] for a in at], [weight[a] for a in at], [color[a] for a in at]
        circle = [circles[k] for k in t]
        size = np.abs(circle[0])
        sum_w = (w[0] + w[1]) + (w[2] + w[3])
        put = (_least(t) >= (0 if level == 1 else begin[level - 2])) & (size >= _LEAST_CIRCLE * side)
        put &= _most(circle) - _least(circle) <= _MOST_STEP * size
        put &= _least(w) > _LEAST_SHARE * sum_w.astype(np.float64)
        contrast, four = _most(c) - _least(c), (c[0] + c[1]) + (c[2] + c[3])
        allowed = _MOST_CONTRAST * size / side
        put &= contrast[..., :3].max(axis=-1, initial=0.0) <= allowed * 0.25 * four[..., :3].max(
            axis=-1, initial=0.0
        )
        put &= (contrast[..., 3] <= allowed) & (c[0][..., 3] >= least_alpha)
        put &= four[..., :3].sum(axis=-1, dtype=np.float64) <= 12.0 * brightest
        marks = (mark_1[..., np.newaxis], mark_2[..., np.newaxis]) if marked else ()
        for values in (color, *marks):
            light = [values[a][put] * v[put][:, np.newaxis] for a, v in zip(at, w, strict=True)]
            mean = ((light[0] + light[1]) + (light[2] + light[3])) / sum_w[put][:, np.newaxis]
            values[at[0]][put] = mean
        weight[at[0]][put] = sum_w[put]
        size = ((circle[0] + circle[1]) + (circle[2] + circle[3]))[put] * 0.25
        of_mean = np.copysign(np.rint(_TABLES_PER_E * np.log(np.abs(size))), size).astype(np.int64)
        for k, a in enumerate(at):
            table[a][put] = begin[level - 1] + of_mean - lowest
            if k > 0:
                weight[a][put] = 0.0


def _least(values: list[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    return np.asarray(np.minimum.reduce(values))


def _most(values: list[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    return np.asarray(np.maximum.reduce(values))

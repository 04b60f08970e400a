# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Arrays of any type, shape and stride, as they reach the C interface: what is taken comes back as it was meant, and all
else raises. No device is needed. SEMROVER_ARRAY_SEEDS: how many rounds (2000)."""
import ctypes
import gc
import os
import unittest

import numpy

import semrover
from semrover import _abi
from semrover.grid import CELL, cells_of

ROUNDS = int(os.environ.get("SEMROVER_ARRAY_SEEDS", "2000"))
TYPES = ("i1", "u1", "<i2", ">i2", "<i4", ">i4", "<u4", "<i8", ">i8", "<u8", "f4", "f8", "?", "O", "c8", "S3", "M8[s]")
REFUSED = (ValueError, TypeError, OverflowError, ctypes.ArgumentError)  # semrover's own errors for numbers are ValueErrors


def strided(random, array):
    """the same numbers, elsewhere in memory: sliced, reversed, of the other order, read-only or not aligned"""
    way = random.integers(6) if array.ndim else 3
    if way == 0:
        wide = numpy.empty(tuple(2 * n for n in array.shape), array.dtype)
        part = wide[tuple(slice(None, None, 2) for _ in array.shape)]
        part[...] = array
        return part
    if way == 1:
        return array[::-1].copy()[::-1]
    if way == 2:
        return numpy.asfortranarray(array)
    if way == 3:
        array = array.copy()
        array.flags.writeable = False
        return array
    if way == 4 and array.dtype.kind != "O":
        raw = numpy.empty(array.nbytes + 1, numpy.uint8)
        shifted = raw[1:].view(array.dtype).reshape(array.shape)
        shifted[...] = array
        return shifted
    return array


def expected_cells(cells):
    """{(i, j, k): label}, by hand"""
    found = {}
    for row in cells:
        i, j, k, label = (int(v) for v in row)
        found.pop((i, j, k), None)
        if label != semrover.NO_CELL:
            found[i, j, k] = label
    return found


def cells_in(grid):
    return {(int(c["i"]), int(c["j"]), int(c["k"])): int(c["label"]) for c in grid.cells}


class Arrays(unittest.TestCase):
    def test_cells_come_back_or_are_refused(self):
        taken = 0
        for seed in range(ROUNDS):
            random = numpy.random.default_rng(seed)
            shape = [(random.integers(6), 4), (4,), (2, 3), (2, 2, 4), (), (0, 4), (0,)][random.integers(7)]
            numbers = random.integers(0, 20, shape)
            dtype = numpy.dtype(TYPES[random.integers(len(TYPES))])
            array = strided(random, numbers.astype(dtype) if dtype.kind != "M" else numbers.astype("i8").astype(dtype))
            grid = semrover.Grid(0.6)
            if dtype.kind in "iu" and len(shape) == 2 and shape[1] == 4:
                grid.set_cells(array)
                self.assertEqual(cells_in(grid), expected_cells(numbers), (seed, dtype, shape))
                taken += 1
            else:
                with self.assertRaises(REFUSED, msg=(seed, dtype, shape)):
                    grid.set_cells(array)
        self.assertGreater(taken, ROUNDS // 20)

    def test_numbers_out_of_range_are_refused_and_change_nothing(self):
        grid = semrover.Grid(0.6, [[0, 0, 0, 1]])
        for bad in ([[2**31, 0, 0, 1]], [[0, -2**40, 0, 1]], [[0, 0, 0, -1]], [[0, 0, 0, 2**32]], [[0, 0, 0, 20]],
                    [[2**20 + 1, 0, 0, 1]], numpy.array([[2**63, 0, 0, 1]], numpy.uint64)):
            with self.assertRaises(REFUSED, msg=bad):
                grid.set_cells(bad)
            self.assertEqual(cells_in(grid), {(0, 0, 0): 1}, bad)

    def test_structured_cells_of_any_layout(self):
        for seed in range(ROUNDS // 4):
            random = numpy.random.default_rng(seed)
            cells = numpy.zeros(random.integers(1, 9), CELL)
            for name in CELL.names:
                cells[name] = random.integers(0, 20, len(cells))
            array = strided(random, cells)
            self.assertTrue((cells_of(array) == cells).all())
            other = numpy.dtype([(n, ">i8") for n in CELL.names])
            with self.assertRaises(REFUSED):
                cells_of(array.astype(other))

    def test_dense_labels_of_any_layout(self):
        for seed in range(ROUNDS // 2):
            random = numpy.random.default_rng(seed)
            shape = tuple(random.integers(0, 5, random.integers(1, 5)))
            labels = random.integers(0, 20, shape)
            labels[random.random(shape) < 0.5] = 255
            dtype = numpy.dtype(("u1", "<i2", ">i4", "<i8", "<u8", "f4", "?")[random.integers(7)])
            array = strided(random, labels.astype(dtype))
            origin = tuple(int(v) for v in random.integers(-9, 9, 3))
            if len(shape) == 3 and dtype.kind in "iu":
                back, at = semrover.Grid.from_labels(array, origin=origin).to_labels()
                self.assertEqual((back != 255).sum(), (labels != 255).sum())
                for place in numpy.argwhere(back != 255):
                    self.assertEqual(back[tuple(place)], labels[tuple(place + numpy.array(at) - numpy.array(origin))])
            else:
                with self.assertRaises(REFUSED, msg=(seed, dtype, shape)):
                    semrover.Grid.from_labels(array, origin=origin)

    def test_numbers_that_c_has_no_room_for_do_not_wrap(self):
        for number in (2**32, -2**32 + 1, -1, numpy.int64(2**33)):
            with self.assertRaises(REFUSED, msg=number):
                semrover.class_color(number)
            with self.assertRaises(REFUSED, msg=number):
                _abi.sr_world_desc(steps=number)
            with self.assertRaises(REFUSED, msg=number):
                _abi.sr_world_desc().tiles_at_once = number
        for low in ((2**32, 0), (0, -2**31 - 1)):
            with self.assertRaises(REFUSED, msg=low):
                _abi.sr_cell_rect(low, (1, 1))
        self.assertEqual(list(_abi.sr_cell_rect((numpy.int64(-3), 4), (5, 6)).low), [-3, 4])
        self.assertEqual(_abi.sr_world_desc(seed=2**64 - 1, tile_size=4).seed, 2**64 - 1)

    def test_views_outlive_their_grid(self):
        grid = semrover.Grid(0.6, [[1, 2, 3, 4]])
        cells = grid.cells
        grid.close()
        del grid
        gc.collect()
        self.assertEqual(cells.tolist(), [(1, 2, 3, 4)])


if __name__ == "__main__":
    unittest.main()

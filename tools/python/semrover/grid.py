# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Grids of labelled voxels, in host memory."""
import ctypes
import os

import numpy

from . import _abi
from ._library import Handle, check, lib, made

CELL = numpy.dtype([("i", "<i4"), ("j", "<i4"), ("k", "<i4"), ("label", "<u4")])  # as sr_cell
NO_CELL = _abi.SR_NO_CELL
CLASSES = tuple(lib.sr_class_name(n).decode() for n in range(_abi.SR_CLASSES))


def class_color(label):
    """(r, g, b) of a class in the palette, 0..255"""
    color = (ctypes.c_uint8 * 3)()
    check(lib.sr_class_color(label, color))
    return tuple(color)


def cells_of(cells):
    """An array of CELL, of one or of integers [N, 4]: i, j, k, label. UsageError: another shape or type."""
    cells = numpy.asarray(cells)
    if cells.dtype == CELL:
        return numpy.ascontiguousarray(cells.ravel())
    if cells.ndim != 2 or cells.shape[1] != 4 or cells.dtype.kind not in "iu":
        raise ValueError(f"cells: expected integers [N, 4], found {cells.dtype} {list(cells.shape)}")
    if cells.size and (cells[:, :3].min() < -2**31 or cells[:, :3].max() >= 2**31 or cells[:, 3].min() < 0
                       or cells[:, 3].max() >= 2**32):
        raise ValueError("cells: a number is out of the range of 32 bits")
    made_of = numpy.empty(len(cells), CELL)
    for axis, name in enumerate(CELL.names):
        made_of[name] = cells[:, axis]
    return made_of


def cell_pointer(cells):
    return cells.ctypes.data_as(ctypes.POINTER(_abi.sr_cell))


class Grid(Handle):
    """Labelled voxels of one size, each with coloured points or none. Cell (i, j, k) spans [i, i + 1) x [j, j + 1) x
    [k, k + 1) voxel sizes: x forward, y left, z up.

    voxel_size: metres. cells: integers [N, 4], or an array of CELL.
    """

    def __init__(self, voxel_size=0.6, cells=None):
        pointer = ctypes.c_void_p()
        check(lib.sr_grid_create(voxel_size, pointer))
        super().__init__(pointer, lib.sr_grid_destroy)
        if cells is not None:
            self.set_cells(cells)

    @classmethod
    def _of(cls, pointer):
        grid = cls.__new__(cls)
        Handle.__init__(grid, pointer, lib.sr_grid_destroy)
        return grid

    @classmethod
    def read(cls, path):
        """of a .sgrid file or a folder of tiles"""
        pointer = ctypes.c_void_p()
        check(lib.sr_grid_read(os.fsencode(path), pointer))
        return cls._of(pointer)

    @classmethod
    def from_labels(cls, labels, voxel_size=0.6, origin=(0, 0, 0), empty=255):
        """Of a dense array: labels [X, Y, Z], integers, `empty` for no voxel; origin: cell of labels[0, 0, 0]."""
        labels = numpy.asarray(labels)
        if labels.ndim != 3 or labels.dtype.kind not in "iu":
            raise ValueError(f"labels: expected integers [X, Y, Z], found {labels.dtype} {list(labels.shape)}")
        at = numpy.argwhere(labels != empty)
        return cls(voxel_size, numpy.column_stack([at + numpy.asarray(origin), labels[tuple(at.T)].astype(numpy.int64)]))

    def to_labels(self, empty=255):
        """(labels [X, Y, Z] uint8, origin): the smallest dense array that holds all voxels"""
        cells = self.cells
        if not len(cells):
            return numpy.full((0, 0, 0), empty, numpy.uint8), (0, 0, 0)
        at = numpy.column_stack([cells["i"], cells["j"], cells["k"]])
        low = at.min(axis=0)
        labels = numpy.full(at.max(axis=0) - low + 1, empty, numpy.uint8)
        labels[tuple((at - low).T)] = cells["label"]
        return labels, tuple(int(v) for v in low)

    def set_cells(self, cells):
        """Adds voxels, changes labels, or takes voxels away (label NO_CELL); of equal ones the last counts."""
        cells = cells_of(cells)
        check(lib.sr_grid_set_cells(self.handle, cell_pointer(cells), len(cells)))

    def write(self, path):
        """a .sgrid, whole or not at all"""
        check(lib.sr_grid_write(self.handle, os.fsencode(path)))

    def _info(self):
        info = made(_abi.sr_grid_info)
        check(lib.sr_grid_get_info(self.handle, info))
        return info

    def __len__(self):
        """voxels"""
        return self._info().cells

    @property
    def voxel_size(self):
        """metres"""
        return self._info().voxel_size

    @property
    def points_per_voxel(self):
        """0: there are labels only"""
        return self._info().points_per_voxel

    @property
    def cells(self):
        """a copy: [N] of CELL, sorted by i, j, k"""
        cells, written = numpy.empty(len(self), CELL), ctypes.c_uint64()
        check(lib.sr_grid_get_cells(self.handle, 0, len(cells), cell_pointer(cells), written))
        return cells[:written.value]

    @property
    def points(self):
        """a copy: float32 [N, points_per_voxel, 6] of the same voxels: x y z (metres), r g b (sRGB, 0..1)"""
        info, written = self._info(), ctypes.c_uint64()
        points = numpy.empty((info.cells, info.points_per_voxel, 6), numpy.float32)
        check(lib.sr_grid_get_points(self.handle, 0, info.cells,
                                     points.ctypes.data_as(ctypes.POINTER(ctypes.c_float)), written))
        return points[:written.value]

#!/usr/bin/env python3
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""libsemrover.so from Python: a grid, a world, a place of it.    capi_ctypes.py LIBRARY MODEL"""
import ctypes
import sys
from ctypes import POINTER, byref, c_char_p, c_double, c_float, c_int32, c_uint32, c_uint64, c_void_p


class Cell(ctypes.Structure):
    _fields_ = [("i", c_int32), ("j", c_int32), ("k", c_int32), ("label", c_uint32)]


class Window(ctypes.Structure):
    _fields_ = [("low", c_int32 * 2), ("high", c_int32 * 2)]


class ModelDesc(ctypes.Structure):
    _fields_ = [("struct_size", c_uint32), ("parts", c_uint32), ("next", c_void_p), ("path", c_char_p)]


class WorldDesc(ctypes.Structure):
    _fields_ = [("struct_size", c_uint32), ("steps", c_uint32), ("next", c_void_p), ("model", c_void_p),
                ("grid", c_void_p), ("folder", c_char_p), ("labels", c_void_p), ("message", c_void_p),
                ("user", c_void_p), ("cache", c_char_p), ("generation", c_void_p), ("objects", c_void_p),
                ("object_count", c_uint64), ("seed", c_uint64), ("host_bytes", c_uint64), ("splat_bytes", c_uint64),
                ("tile_size", c_double), ("splat_radius", c_double), ("tiles_at_once", c_uint32), ("conditioning", c_uint32)]


library = ctypes.CDLL(sys.argv[1])
# pointers do not fit the int that ctypes takes arguments for
library.sr_last_error.argtypes = [c_void_p, c_char_p, ctypes.c_size_t]
library.sr_last_error.restype = ctypes.c_size_t
library.sr_context_create.argtypes = [c_void_p, POINTER(c_void_p)]
library.sr_grid_create.argtypes = [c_double, POINTER(c_void_p)]
library.sr_grid_set_cells.argtypes = [c_void_p, POINTER(Cell), c_uint64]
library.sr_grid_get_points.argtypes = [c_void_p, c_uint64, c_uint64, POINTER(c_float), POINTER(c_uint64)]
library.sr_model_load.argtypes = [c_void_p, POINTER(ModelDesc), POINTER(c_void_p)]
library.sr_world_create.argtypes = [c_void_p, POINTER(WorldDesc), POINTER(c_void_p)]
library.sr_world_focus.argtypes = [c_void_p, POINTER(c_double), POINTER(c_double), c_double]
library.sr_world_step.argtypes = [c_void_p, c_uint64, POINTER(c_uint32)]
library.sr_world_copy_cells.argtypes = [c_void_p, POINTER(Window), POINTER(c_void_p)]
for destroy in (library.sr_context_destroy, library.sr_grid_destroy, library.sr_model_destroy, library.sr_world_destroy):
    destroy.argtypes, destroy.restype = [c_void_p], None

context, model, grid, world, made = (c_void_p() for _ in range(5))


def check(status):
    if status:
        line = ctypes.create_string_buffer(512)
        library.sr_last_error(context, line, 512) or library.sr_last_error(None, line, 512)
        sys.exit(f"status {status}: {line.value.decode()}")


check(library.sr_context_create(None, byref(context)))
check(library.sr_grid_create(0.6, byref(grid)))
cells = [Cell(i, j, 0, 0) for i in range(16) for j in range(-8, 8)]
check(library.sr_grid_set_cells(grid, (Cell * len(cells))(*cells), len(cells)))
model_desc = ModelDesc(struct_size=ctypes.sizeof(ModelDesc), path=sys.argv[2].encode())
check(library.sr_model_load(context, byref(model_desc), byref(model)))
desc = WorldDesc(struct_size=ctypes.sizeof(WorldDesc), steps=2, model=model, grid=grid, tile_size=4.8)
check(library.sr_world_create(context, byref(desc), byref(world)))
check(library.sr_world_focus(world, (c_double * 3)(4, 0, 1), (c_double * 3)(1, 0, 0), 20))
done = c_uint32(0)
while not done.value:
    check(library.sr_world_step(world, 20000, byref(done)))
check(library.sr_world_copy_cells(world, Window((0, -8), (15, 7)), byref(made)))
points = (c_float * (len(cells) * 20 * 6))()
written = c_uint64(0)
check(library.sr_grid_get_points(made, 0, len(cells), points, byref(written)))
assert written.value == len(cells), written.value
assert all(-0.01 <= x <= 16 * 0.6 + 0.01 for x in points[0::6]) and max(points[0::6]) > 9
assert all(0 <= r <= 1 for r in points[3::6])
for destroy, handle in ((library.sr_grid_destroy, made), (library.sr_world_destroy, world),
                        (library.sr_model_destroy, model), (library.sr_grid_destroy, grid), (library.sr_context_destroy, context)):
    destroy(handle)

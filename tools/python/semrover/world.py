# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Streets of any extent, generated around cameras and drawn."""
import ctypes
import os
from dataclasses import dataclass

import numpy

from . import _abi
from ._library import Handle, check, fields_of, guarded, lib, lines_to, made
from .camera import Camera, rows_of
from .grid import CELL, Grid, cell_pointer, cells_of

CONDITIONING = ("guessed", "none", "given")
FLOW_STATES = ("nothing", "seen", "hidden", "outside")
RETURN = numpy.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u4"),
                      ("label", "<u4"), ("instance", "<u4"), ("time_us", "<u4")])  # as sr_lidar_return
OBJECT = numpy.dtype([("id", "<u4"), ("label", "<u4"), ("center", "<f8", 3), ("size", "<f8", 3), ("heading", "<f8"),
                      ("color", "<f4", 3), ("colored", "<u4"), ("part", "<u4"), ("reserved", "<u4")])  # as sr_object
FARTHEST = 2000.0  # metres, that a focus reaches
SPLAT_BYTES = 60

# VkFormat, array and channels of each picture, by dtype; the first is the default
_FORMATS = {
    "color": {"float32": (109, 4), "float16": (97, 4), "uint8": (37, 4)},
    "normal": {"float32": (109, 4), "float16": (97, 4), "int8": (38, 4)},
    "depth": {"float32": (103, 2), "float16": (76, 1)},
    "label": {"uint32": (101, 2), "uint8": (13, 1)},
    "instance": {"uint32": (98, 1)},
}


def read_objects(path):
    """[N] of OBJECT, of an objects.json"""
    count = ctypes.c_uint64()
    check(lib.sr_read_objects(os.fsencode(path), None, count))
    objects = numpy.zeros(count.value, OBJECT)
    check(lib.sr_read_objects(os.fsencode(path), _objects_pointer(objects), count))
    return objects[:count.value]


def _objects_pointer(objects):
    return objects.ctypes.data_as(ctypes.POINTER(_abi.sr_object))


@dataclass(frozen=True)
class WorldInfo:
    """Where a world is; fields as of sr_world_info."""

    full: int
    wanted: int  # tiles
    finished: int  # of these
    in_memory: int
    host_bytes: int
    generated: int
    loaded: int
    dropped: int
    splats: int
    voxel_size: float  # metres
    tile_cells: int
    points_per_voxel: int


@dataclass(frozen=True)
class Pick:
    """What is under a pixel."""

    cell: tuple  # i, j, k
    label: int  # NO_CELL: nothing is there
    instance: int  # object + 1; 0: none
    position: tuple  # metres, in the world
    alpha: float


def _target(array, vk_format):
    return _abi.sr_target(memory=array.ctypes.data, format=vk_format)


def _array_for(name, wanted, shape, out):
    """(array, VkFormat) of a picture; wanted: True or a dtype"""
    formats = _FORMATS[name]
    dtype = next(iter(formats)) if wanted is True else numpy.dtype(wanted).name
    if dtype not in formats:
        raise ValueError(f"{name}: expected one of {', '.join(formats)}, found {dtype}")
    vk_format, channels = formats[dtype]
    full = shape + ((channels,) if channels > 1 else ())
    if out is None or name not in out:
        return numpy.empty(full, dtype), vk_format
    array = out[name]
    if array.shape != full or array.dtype != dtype or not array.flags.c_contiguous or not array.flags.writeable:
        raise ValueError(f"out[{name!r}]: expected a contiguous array {dtype} {list(full)}, found {array.dtype} "
                         f"{list(array.shape)}")
    return array, vk_format


class World(Handle):
    """A street. Labels come from one of grid, folder (of tiles) and labels.

    model: a Model with a voxfield transformer; None: the world shows the points that its grid or folder has. labels:
    labels(low, high), both (i, j), gives cells of this rectangle as Grid.set_cells takes them, or None where it does
    not know them yet (labels_ready). cache: a folder for finished tiles. objects: [N] of OBJECT. conditioning: one of
    CONDITIONING. splat_bytes: device memory for splats; None: as the grid's voxels need. message(line) gets warnings.
    Other settings are those of sr_world_desc: steps, generation, seed, host_bytes, tile_size, splat_radius,
    tiles_at_once, detail_distance, portable_cache.
    """

    def __init__(self, context, model=None, grid=None, folder=None, labels=None, cache=None, objects=None,
                 conditioning=None, generation=None, splat_bytes=None, message=None, **settings):
        desc = made(_abi.sr_world_desc)
        for name, value in settings.items():
            if name not in ("steps", "seed", "host_bytes", "tile_size", "splat_radius", "tiles_at_once",
                            "detail_distance", "portable_cache"):
                raise TypeError(f"World: no setting is called {name!r}")
            setattr(desc, name, value)
        desc.model = model.handle if model else None
        desc.grid = grid.handle if grid else None
        desc.folder = os.fsencode(folder) if folder is not None else None
        desc.cache = os.fsencode(cache) if cache is not None else None
        desc.splat_bytes = _splat_bytes(model, grid) if splat_bytes is None else splat_bytes
        if generation is not None:
            desc.generation = ctypes.pointer(generation)
        if objects is not None:
            objects = numpy.ascontiguousarray(objects, OBJECT)
            desc.objects, desc.object_count = _objects_pointer(objects), len(objects)
        if conditioning is None:
            conditioning = "given" if objects is not None and model else "guessed"
        if conditioning not in CONDITIONING:
            raise ValueError(f"conditioning: expected one of {', '.join(CONDITIONING)}, found {conditioning!r}")
        desc.conditioning = CONDITIONING.index(conditioning)
        keep = self._set_callbacks(desc, labels, message)
        pointer = ctypes.c_void_p()
        context._check(lib.sr_world_create(context.handle, desc, pointer))
        super().__init__(pointer, lib.sr_world_destroy, context, keep)
        self.context = context

    @staticmethod
    def _set_callbacks(desc, labels, message):
        """what must live as long as the world"""
        if labels is not None:
            def give(user, rect, grid):
                rect = rect.contents
                cells = labels(tuple(rect.low), tuple(rect.high))
                if cells is None:
                    return _abi.SR_NOT_YET
                cells = cells_of(cells)
                return lib.sr_grid_set_cells(grid, cell_pointer(cells), len(cells))
            desc.labels = type(desc.labels)(guarded(give, _abi.SR_ERR_INTERRUPTED))
        if message is not None:
            desc.message = lines_to(type(desc.message), message)
        return desc.labels, desc.message

    # ---- making

    def focus(self, position, direction=(1, 0, 0), radius=60.0):
        """What is wanted from now on: all tiles within `radius` metres (up to 2000), seen from above; nearest first,
        and what lies in `direction` before what lies behind."""
        self.foci([(position, direction, radius)])

    def foci(self, places):
        """The same of several, up to 64: (position, direction, radius) each."""
        foci = (_abi.sr_focus * len(places))()
        for focus, (position, direction, radius) in zip(foci, places):
            focus.position, focus.direction = tuple(map(float, position)), tuple(map(float, direction))
            focus.radius = radius
        self._check(lib.sr_world_foci(self.handle, foci, len(foci)))

    def step(self, seconds=0.02):
        """Works for about so long; 0: one piece. True: all that is wanted is finished."""
        done = ctypes.c_uint32()
        self._check(lib.sr_world_step(self.handle, int(seconds * 1e6), done))
        return bool(done.value)

    def fill(self, seconds=0.2):
        """Yields WorldInfo after each step until what is wanted is finished. Ctrl-C stops it between steps."""
        done = False
        while not done:
            done = self.step(seconds)
            info = self.info
            yield info
            if info.full and done:
                return

    def fill_grid(self, grid, seconds=0.2):
        """The same of everywhere that a grid has voxels, focus after focus."""
        for position, radius in _circles(grid):
            self.focus(position, radius=radius)
            yield from self.fill(seconds)

    def fill_along(self, poses, radius=60.0, seconds=0.2):
        """The same of a trajectory: poses [N, 4, 4] or positions [N, 3], metres."""
        poses = numpy.asarray(poses, float)
        positions = poses[:, :3, 3] if poses.ndim == 3 else poses
        ahead = numpy.gradient(positions, axis=0) if len(positions) > 1 else numpy.array([[1.0, 0, 0]])
        for position, direction in zip(positions, ahead):
            self.focus(position, direction, radius)
            yield from self.fill(seconds)

    def edit(self, cells):
        """Changes labels as Grid.set_cells does; the next steps generate what depends on them anew."""
        cells = cells_of(cells)
        self._check(lib.sr_world_edit(self.handle, cell_pointer(cells), len(cells)))

    def labels_ready(self, low, high):
        """labels() knows the rectangle for which it returned None."""
        self._check(lib.sr_world_labels_ready(self.handle, _abi.sr_cell_rect(tuple(low), tuple(high))))

    def flush(self):
        """Waits until the cache has all that is finished."""
        self._check(lib.sr_world_flush(self.handle))

    @property
    def info(self):
        """WorldInfo"""
        info = made(_abi.sr_world_info)
        self._check(lib.sr_world_get_info(self.handle, info))
        return fields_of(WorldInfo, info)

    def copy_cells(self, low=(-2**20, -2**20), high=(2**20, 2**20)):
        """A Grid of the finished voxels of low <= (i, j) <= high that are in memory, with their points."""
        pointer = ctypes.c_void_p()
        self._check(lib.sr_world_copy_cells(self.handle, _abi.sr_cell_rect(tuple(low), tuple(high)), pointer))
        return Grid._of(pointer)

    # ---- drawing

    def set_actors(self, actors):
        """How objects move: {object's id: [(seconds, pose to the world [4, 4]), ..]}, times ascending. Others stand."""
        made_of = (_abi.sr_actor * len(actors))()
        keep = []
        for actor, (number, poses) in zip(made_of, actors.items()):
            row = (_abi.sr_actor_pose * len(poses))()
            for pose, (seconds, matrix) in zip(row, poses):
                pose.time_us, pose.pose = round(seconds * 1e6), rows_of(matrix, "pose")
            keep.append(row)
            actor.object, actor.pose_count, actor.poses = number, len(poses), row
        self._check(lib.sr_world_set_actors(self.handle, made_of, len(made_of)))

    def draw(self, camera: Camera, color=True, normal=False, depth=False, label=False, instance=False,
             color_linear=False, out=None):
        """Pictures of what is there, as {name: array}. Each is False, True or a dtype. `out`: arrays to draw into.

        color [H, W, 4]: r g b times alpha, alpha (float32, float16, uint8). normal [H, W, 4]: camera's frame, times
        weight; depth's sum (float32, float16, int8). depth [H, W, 2] metres, mean and median (float32); [H, W] mean
        (float16). label [H, W, 2]: class, low bits of the voxel (uint32); [H, W] class, 255 for none (uint8). instance
        [H, W]: object + 1 (uint32).
        """
        desc, pictures = self._desc(camera), {}
        desc.color_linear = bool(color_linear)
        wanted = {"color": color, "normal": normal, "depth": depth, "label": label, "instance": instance}
        for name, kind in wanted.items():
            if kind is False:
                continue
            pictures[name], vk_format = _array_for(name, kind, (camera.height, camera.width), out)
            setattr(desc, name, _target(pictures[name], vk_format))
        self._check(lib.sr_world_draw(self.handle, desc))
        return pictures

    def flow(self, now: Camera, then: Camera):
        """(flow [H, W, 2] float32, states [H, W] uint32): where what a pixel shows is in the other picture, pixels to
        the right and down, 1e10 where it is not known; number of FLOW_STATES."""
        flow = numpy.empty((now.height, now.width, 2), numpy.float32)
        states = numpy.empty((now.height, now.width), numpy.uint32)
        self._check(lib.sr_world_flow(self.handle, self._desc(now), self._desc(then), _target(flow, 103),
                                      _target(states, 98)))
        return flow, states

    def sweep(self, lidar, end_to_world, begin_to_world=None, time=0.0, least_alpha=0.5):
        """Returns of a lidar's turn, [N] of RETURN, in its axes at the end. lidar: name of a table or a .json file.
        Poses [4, 4] of the sensor (x forward, y left, z up); without begin_to_world it stands."""
        begin = end_to_world if begin_to_world is None else begin_to_world
        desc = made(_abi.sr_sweep_desc, lidar=os.fsencode(lidar), time=time, least_alpha=least_alpha,
                    sensor_to_world_begin=rows_of(begin, "begin_to_world"),
                    sensor_to_world_end=rows_of(end_to_world, "end_to_world"))
        count = ctypes.c_uint64()
        self._check(lib.sr_world_sweep(self.handle, desc, None, count))
        returns = numpy.empty(count.value, RETURN)
        self._check(lib.sr_world_sweep(self.handle, desc,
                                       returns.ctypes.data_as(ctypes.POINTER(_abi.sr_lidar_return)), count))
        return returns[:count.value]

    def pick(self, camera: Camera, x, y):
        """What is under a pixel."""
        found = made(_abi.sr_pick)
        self._check(lib.sr_world_pick(self.handle, self._desc(camera), x, y, found))
        cell = found.cell
        return Pick((cell.i, cell.j, cell.k), cell.label, found.instance, tuple(found.position), found.alpha)

    @staticmethod
    def _desc(camera):
        desc = made(_abi.sr_draw_desc)
        camera.fill(desc)
        return desc


def _splat_bytes(model, grid):
    """for the points of all voxels of a grid, and an eighth more"""
    if grid is None:
        return 0
    points = model.info.points_per_voxel if model else grid.points_per_voxel
    return len(grid) * max(points, 1) * SPLAT_BYTES * 9 // 8 + (1 << 20)


def _circles(grid):
    """(position, radius) that cover a grid's voxels, seen from above"""
    cells = grid.cells
    if not len(cells):
        return
    size, across = grid.voxel_size, FARTHEST  # a square of this edge fits into the circle
    at = numpy.stack([cells["i"], cells["j"]], axis=1) + 0.5
    for square in numpy.unique(numpy.floor(at * size / across).astype(int), axis=0):
        within = at[(numpy.floor(at * size / across) == square).all(axis=1)] * size
        low, high = within.min(axis=0), within.max(axis=0)
        yield (*((low + high) / 2), 0.0), float(numpy.hypot(*(high - low)) / 2 + size)


assert CELL.itemsize == ctypes.sizeof(_abi.sr_cell) and OBJECT.itemsize == ctypes.sizeof(_abi.sr_object)

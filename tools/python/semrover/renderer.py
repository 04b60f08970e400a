# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Frames that a diffusion network makes of what a camera sees."""
import ctypes
from dataclasses import dataclass

import numpy

from . import _abi
from ._library import Handle, fields_of, lib, lines_to, made

NOISES = ("model", "fresh", "surfaces")
_RGBA8 = 37  # VK_FORMAT_R8G8B8A8_UNORM


@dataclass(frozen=True)
class RendererInfo:
    """Where a renderer is; fields as of sr_renderer_info."""

    steps: int
    frames: int  # finished
    noise: int
    busy: int
    resident: int
    device_bytes: int
    splat_radius: float  # metres, for World(splat_radius=..); 0: from the distance of the points
    visible_alpha: float


class Renderer(Handle):
    """The frames of one camera, each from its splat buffer and the frame before: the bytes of `semrover refine`.

    model: with a renderer. steps: 0: as the model says. camera: its name, where there are several. noise: of NOISES.
    """

    def __init__(self, context, model, width, height, steps=0, seed=0, camera=None, noise="model", message=None):
        if noise not in NOISES:
            raise ValueError(f"noise: expected one of {', '.join(NOISES)}, found {noise!r}")
        desc = made(_abi.sr_renderer_desc, model=model.handle, width=width, height=height, steps=steps, seed=seed,
                    camera=None if camera is None else camera.encode(), noise=NOISES.index(noise))
        if message is not None:
            desc.message = lines_to(type(desc.message), message)
        pointer = ctypes.c_void_p()
        context._check(lib.sr_renderer_create(context.handle, desc, pointer))
        super().__init__(pointer, lib.sr_renderer_destroy, context, (desc.message,))
        self.context, self.width, self.height = context, width, height

    def frame(self, world, camera, seconds=0.1):
        """The next frame, uint8 [H, W, 3], sRGB, of a world's splats. Ctrl-C gives it up."""
        desc = made(_abi.sr_frame_desc, world=world.handle)
        camera.fill(desc)
        return self._finish(desc, seconds)

    def frame_of(self, seen, depth=None, camera=None, seconds=0.1):
        """The next frame of buffers: seen uint8 [H, W, 4] (r g b over black; 255 where splats cover it, else 0); depth
        uint16 [H, W], millimetres along z, and the camera, where noise stays on surfaces."""
        desc = made(_abi.sr_frame_desc)
        desc.seen.memory = self._buffer("seen", seen, numpy.uint8, (self.height, self.width, 4)).ctypes.data
        if depth is not None:
            desc.depth.memory = self._buffer("depth", depth, numpy.uint16, (self.height, self.width)).ctypes.data
        if camera is not None:
            camera.fill(desc)
        return self._finish(desc, seconds)

    def frames(self, world, cameras, seconds=0.1):
        """Yields a frame for each camera."""
        for camera in cameras:
            yield self.frame(world, camera, seconds)

    @staticmethod
    def _buffer(name, array, dtype, shape):
        array = numpy.asarray(array)
        if array.dtype != dtype or array.shape != shape or not array.flags.c_contiguous:
            raise ValueError(f"{name}: expected a contiguous array {numpy.dtype(dtype)} {list(shape)}, found "
                             f"{array.dtype} {list(array.shape)}")
        return array

    def _finish(self, desc, seconds):
        self._check(lib.sr_renderer_begin(self.handle, desc))
        done = ctypes.c_uint32()
        try:
            while not done.value:
                self._check(lib.sr_renderer_step(self.handle, int(seconds * 1e6), done))
        except BaseException:
            lib.sr_renderer_cancel(self.handle)
            raise
        pixels = numpy.empty((self.height, self.width, 4), numpy.uint8)
        self._check(lib.sr_renderer_take(self.handle, _abi.sr_target(memory=pixels.ctypes.data, format=_RGBA8)))
        return pixels[:, :, :3]

    def restart(self):
        """The next frame has none before it: after a cut."""
        self._check(lib.sr_renderer_restart(self.handle))

    @property
    def info(self):
        """RendererInfo"""
        info = made(_abi.sr_renderer_info)
        self._check(lib.sr_renderer_get_info(self.handle, info))
        return fields_of(RendererInfo, info)

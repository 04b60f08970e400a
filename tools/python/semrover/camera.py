# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Cameras, and what else looks at a world."""
from dataclasses import dataclass, field, replace

import numpy

from . import _abi

MODELS = ("pinhole", "opencv", "fisheye", "equirectangular", "ftheta")
SHUTTERS = ("global", "down", "up", "right", "left")
# a camera at the vehicle's origin (x forward, y left, z up) that looks forward; camera axes are x right, y down, z
# forward
FORWARD = numpy.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)


def number_of(names, name, what):
    if name not in names:
        raise ValueError(f"{what}: expected one of {', '.join(names)}, found {name!r}")
    return names.index(name)


def rows_of(matrix, what):
    """twelve numbers of a rigid matrix [4, 4] or [3, 4]"""
    matrix = numpy.asarray(matrix, float)
    if matrix.shape not in ((4, 4), (3, 4)):
        raise ValueError(f"{what}: expected a matrix [4, 4], found {list(matrix.shape)}")
    return tuple(matrix[:3].ravel().tolist())


def inverse(matrix):
    """of a rigid matrix [4, 4]"""
    matrix = numpy.asarray(matrix, float)
    made = numpy.eye(4)
    made[:3, :3] = matrix[:3, :3].T
    made[:3, 3] = -made[:3, :3] @ matrix[:3, 3]
    return made


def look(position, heading=0.0, pitch=0.0):
    """camera to world [4, 4] of a camera that looks along `heading` (radians from x towards y) and up by `pitch`"""
    c, s, cp, sp = numpy.cos(heading), numpy.sin(heading), numpy.cos(pitch), numpy.sin(pitch)
    vehicle = numpy.array([[c * cp, -s, -c * sp, 0], [s * cp, c, -s * sp, 0], [sp, 0, cp, 0], [0, 0, 0, 1]])
    vehicle[:3, 3] = position
    return vehicle @ FORWARD


@dataclass(frozen=True)
class Camera:
    """A camera in OpenCV's convention: x right, y down, z forward; the centre of pixel (x, y) lies at (x + 0.5,
    y + 0.5). Lengths are metres, times seconds, focal lengths pixels.

    model: one of MODELS; distortion: up to 12 numbers as sr_draw_desc has them. shutter: one of SHUTTERS; if it is not
    "global", `readout` is (start, end) in seconds from `time`, and `readout_to_world` are the poses then.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    camera_to_world: numpy.ndarray = field(default_factory=lambda: numpy.eye(4))  # [4, 4]
    model: str = "pinhole"
    distortion: tuple = ()
    time: float = 0.0
    shutter: str = "global"
    readout: tuple = (0.0, 0.0)
    readout_to_world: tuple = ()  # two of [4, 4]

    @classmethod
    def of_view(cls, width, height, fov_x, camera_to_world=None, **more):
        """a pinhole with square pixels; fov_x: degrees across the width"""
        focal = width / (2 * numpy.tan(numpy.radians(fov_x) / 2))
        pose = numpy.eye(4) if camera_to_world is None else camera_to_world
        return cls(width, height, focal, focal, width / 2, height / 2, pose, **more)

    def at(self, camera_to_world, time=None):
        """the same camera somewhere else"""
        return replace(self, camera_to_world=camera_to_world, time=self.time if time is None else time)

    def fill(self, desc):
        """puts it into a sr_draw_desc or sr_frame_desc"""
        desc.fx, desc.fy, desc.cx, desc.cy = self.fx, self.fy, self.cx, self.cy
        desc.world_to_camera = rows_of(inverse(self.camera_to_world), "camera_to_world")
        desc.time = self.time
        if not isinstance(desc, _abi.sr_draw_desc):
            if self.model != "pinhole" or self.shutter != "global":
                raise ValueError("a renderer's camera is a pinhole with a global shutter")
            return
        desc.width, desc.height = self.width, self.height
        desc.camera_model = number_of(MODELS, self.model, "model")
        if len(self.distortion) > 12:
            raise ValueError(f"distortion: expected up to 12 numbers, found {len(self.distortion)}")
        desc.distortion = tuple(self.distortion) + (0.0,) * (12 - len(self.distortion))
        desc.shutter = number_of(SHUTTERS, self.shutter, "shutter")
        if self.shutter != "global":
            if len(self.readout_to_world) != 2:
                raise ValueError("readout_to_world: expected the poses at the start and at the end of the readout")
            start, end = (rows_of(inverse(pose), "readout_to_world") for pose in self.readout_to_world)
            desc.world_to_camera_start, desc.world_to_camera_end = start, end
            desc.readout_start, desc.readout_end = self.readout

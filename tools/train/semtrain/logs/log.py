# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What the reader of a layout gives: `read(folder, scene, frames) -> Log`. Times are seconds, poses 4x4 matrices to the
world; cameras have OpenCV's axes (x right, y down, z forward), lidars x forward, y left, z up."""
from typing import Any, Callable, NamedTuple, Optional

import numpy as np


class Picture(NamedTuple):
    time: float
    pose: np.ndarray
    path: str  # where it lies, for messages
    name: str  # its file's, without the ending: labels by other programs are called alike
    read: Callable[[], np.ndarray]                       # u8 [h, w, 3]
    labels: Optional[Callable[[], np.ndarray]] = None    # class numbers [h, w]; the log's table says whose
    sky: Optional[Callable[[], np.ndarray]] = None       # [h, w], not 0 where sky is
    depth: Optional[Callable[[], np.ndarray]] = None     # metres along the axis [h, w], 0 for nothing


class Camera(NamedTuple):
    name: str
    lens: Any       # lens.OpenCv or lens.Mei
    pictures: list  # in the order of their times


class Sweep(NamedTuple):
    """of a lidar, with its poses at the begin and the end"""
    begin_time: float
    end_time: float
    begin: np.ndarray
    end: np.ndarray
    boxes_time: float  # of which the boxes are that people drew around its points
    read: Callable[[], np.ndarray]  # [N, 8] in the lidar's axes at the end, as docs/formats.md §6.8 has them


class Log(NamedTuple):
    cameras: list
    sweeps: list
    tracks: list  # boxes.Track
    files: list   # all that was or will be read, for the key of what is made of it
    table: Optional[str] = None  # of the pictures' class numbers


def points_of(xyz, intensity=0, ring=0, microseconds=0, label=255):
    """-> f32 [N, 8]; intensity 0 to 1; no instances"""
    out = np.zeros((len(xyz), 8), np.float32)
    out[:, :3] = xyz
    for column, values in zip((3, 4, 5, 6), (intensity, ring, microseconds, label)):
        out[:, column] = values
    return out


def chosen(frames, numbers):
    """those of `numbers` that lie in `frames`, (first, last) both included, or None: all"""
    return [n for n in numbers if frames is None or frames[0] <= n <= frames[1]]

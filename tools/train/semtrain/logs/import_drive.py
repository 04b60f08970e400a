# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A Log becomes a drive in our own layout (docs/formats.md §6.2, §6.3, §6.8): pictures of pinholes, labels, what
is trained on, sweeps without what moves."""
import os

import numpy as np
from PIL import Image

from ..json_file import write_json
from .boxes import in_boxes, moving_boxes, used_picture
from .label_table import NOTHING, SKY, LabelTable
from .lens import Undistortion, rays_of
from .motion import transformed
from .source import read_label_picture

LIDAR = "lidar"
DEPTH_UNIT = 0.01        # metres of depth pictures
BOXES_OFF = 0.05         # seconds: a box was drawn around what a lidar saw at some time of its sweep
OPENGL = np.diag([1.0, -1, -1, 1])


def write_drive(log, folder, size, labels=None, table=None):
    """size: width, height; labels: a folder CAMERA/NAME.png of class numbers of `table`, in place of the log's own"""
    start = min([p.time for c in log.cameras for p in c.pictures] + [s.begin_time for s in log.sweeps])
    moving = [track for track in log.tracks if track.moves()]
    frames = []
    for camera in log.cameras:
        frames += Pictures(camera, folder, size, moving, labels, table or log.table, len(log.cameras) > 1).write(start)
    about = {"camera_model": "OPENCV"}
    if any("depth_file_path" in frame for frame in frames):
        about["depth_unit_scale_factor"] = DEPTH_UNIT
    write_json(os.path.join(folder, "transforms.json"),
               {**about, "frames": sorted(frames, key=lambda frame: (frame["time"], frame.get("camera", "")))})
    if log.sweeps:
        write_sweeps(log.sweeps, folder, moving, start)


class Pictures:
    """of a camera: color/, label/, depth/ and used/, in its own folder where there are several cameras"""

    def __init__(self, camera, folder, size, moving, labels, table, several):
        self.camera, self.folder, self.moving, self.labels = camera, folder, moving, labels
        self.inner = camera.name if several else ""
        self.table = LabelTable(table) if table else None
        self.undistortion = Undistortion(camera.lens, *size)

    def write(self, start):
        """-> entries of transforms.json; its times begin at `start`"""
        lens, frames = self.undistortion.target, []
        for number, picture in enumerate(self.camera.pictures):
            frame = {"file_path": self._save(number, "color", self._color(picture))}
            boxes = moving_boxes(self.moving, picture.time - BOXES_OFF, picture.time + BOXES_OFF)
            self._save(number, "used", used_picture(picture.pose, lens, boxes))
            depth, labels = self._depth(picture, boxes), self._labels(picture)
            if depth is not None:
                frame["depth_file_path"] = self._save(number, "depth", depth)
            if labels is not None:
                frame["label_file_path"] = self._save(number, "label", labels)
            if self.inner:
                frame["camera"] = self.inner
            frames.append({**frame, "time": round(picture.time - start, 6),
                           "transform_matrix": (picture.pose @ OPENGL).tolist(), "w": lens.width, "h": lens.height,
                           "fl_x": lens.fx, "fl_y": lens.fy, "cx": lens.cx, "cy": lens.cy})
        return frames

    def _save(self, number, kind, pixels):
        path = os.path.join(self.inner, kind, f"{number:06d}.png")
        os.makedirs(os.path.join(self.folder, os.path.dirname(path)), exist_ok=True)
        Image.fromarray(pixels).save(os.path.join(self.folder, path), compress_level=3)
        return path

    def _color(self, picture):
        return self.undistortion.picture(picture.read(), picture.path)

    def _labels(self, picture):
        """u8, or None where there are none"""
        out = None
        if self.labels:
            path = os.path.join(self.labels, self.camera.name, picture.name + ".png")
            out = self.table(self.undistortion.nearest(read_label_picture(path)), path)
        elif picture.labels:
            out = self.table(self.undistortion.nearest(picture.labels()), picture.path)
        if picture.sky and not self.labels:
            sky = self.undistortion.nearest(picture.sky())
            out = np.where(sky != 0, SKY, NOTHING if out is None else out).astype(np.uint8)
        return out

    def _depth(self, picture, boxes):
        """u16 without what moves, or None"""
        if not picture.depth:
            return None
        depth, lens = self.undistortion.nearest(picture.depth()), self.undistortion.target
        a, b = rays_of(lens, self.undistortion.x, self.undistortion.y)
        points = transformed(picture.pose, np.stack([a * depth, b * depth, depth], -1).reshape(-1, 3))
        depth = np.where(in_boxes(points, boxes).reshape(depth.shape), 0, depth / DEPTH_UNIT).round()
        return np.where(depth < 65535, depth, 0).astype(np.uint16)


def write_sweeps(sweeps, folder, moving, start):
    os.makedirs(os.path.join(folder, LIDAR, "points"), exist_ok=True)
    entries = []
    for number, sweep in enumerate(sweeps):
        points = sweep.read()
        times = (sweep.begin_time, sweep.end_time, sweep.boxes_time)
        boxes = moving_boxes(moving, min(times), max(times))
        points = points[~in_boxes(transformed(sweep.end, points[:, :3].astype(float)), boxes)]
        np.save(os.path.join(folder, LIDAR, "points", f"{number:06d}.npy"), points)
        entries.append({"time": round((sweep.end_time - start) * 1e6),
                        "duration": round((sweep.end_time - sweep.begin_time) * 1e6),
                        "begin": sweep.begin.tolist(), "end": sweep.end.tolist()})
    write_json(os.path.join(folder, LIDAR, "sweeps.json"),
               {"format": "semrover.sweeps", "version": 1, "sweeps": entries})

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""KITTI-360, as its documentation (cvlibs.net/datasets/kitti-360/documentation.php) and its scripts read it:
github.com/autonomousvision/kitti360Scripts, helpers/project.py, helpers/annotation.py and devkits/accumuLaser, which
says how points are moved: the scanner turns clockwise, begins behind, and a frame's pose is that at which it looks
ahead."""
import glob
import os
import re
import xml.etree.ElementTree as ET

import numpy as np

from .boxes import track_of
from .lens import Mei, OpenCv
from .log import Camera, Log, Picture, Sweep, chosen, points_of
from .motion import Motion, rigid, transformed
from .source import existing, read_floats, read_label_picture, read_numbers, read_picture, read_text

FIRST_PIXEL = 0.5     # KITTI counts from the centre of the first pixel
TURN = 0.1            # seconds of a sweep, where only one is there
SEAM = np.radians(1)  # points as near to the axis behind are left out: of the begin or the end, which cannot be told
MEI_FIELDS = ("xi", "k1", "k2", "p1", "p2", "gamma1", "gamma2", "u0", "v0")


def is_here(folder):
    return os.path.exists(os.path.join(folder, "calibration", "perspective.txt"))


def read(folder, scene=None, frames=None):
    sequences = sorted(os.listdir(existing(os.path.join(folder, "data_poses"))))
    if scene is None and len(sequences) != 1:
        raise SystemExit(f"{folder}: --scene says which of {', '.join(sequences)}")
    sequence = Sequence(folder, scene or sequences[0])
    numbers = chosen(frames, sequence.numbers)
    if not numbers:
        raise SystemExit(f"{sequence.poses_path}: no pose of the frames {frames}; there are {sequence.numbers[0]} to "
                         f"{sequence.numbers[-1]}")
    cameras = [sequence.camera(name, numbers) for name in sequence.camera_names()]
    return Log(cameras, [sequence.sweep(n) for n in numbers], sequence.tracks(), sequence.files, "kitti360")


def read_rows(path, counts):
    """{name: numbers} of lines `name: numbers`, of the names in `counts`, {name: how many}"""
    lines = dict(line.split(":", 1) for line in read_text(path).splitlines() if ":" in line)
    missing = [name for name in counts if name not in lines]
    if missing:
        raise SystemExit(f"{path}: no line {missing[0]}:")
    return {name: read_numbers(path, lines[name], count) for name, count in counts.items()}


def read_times(path):
    """[N] seconds; a line a frame. An empty line, as KITTI has some, lies between those around it"""
    try:
        times = np.array([line.strip().replace(" ", "T") for line in read_text(path).splitlines()], "datetime64[ns]")
    except ValueError as error:
        raise SystemExit(f"{path}: {error}") from error
    known = np.flatnonzero(~np.isnat(times))
    if not len(known):
        raise SystemExit(f"{path}: no times")
    return np.interp(np.arange(len(times)), known, times[known].astype(np.int64) * 1e-9)


def square(rows):
    return np.vstack([rows.reshape(3, 4), [0, 0, 0, 1]])


class Sequence:
    def __init__(self, folder, name):
        self.folder, self.name = folder, name
        self.calibration = os.path.join(folder, "calibration")
        self.poses_path = os.path.join(folder, "data_poses", name, "poses.txt")
        rows = [read_numbers(self.poses_path, line, 13) for line in read_text(self.poses_path).splitlines()]
        self.numbers, self.poses = [int(row[0]) for row in rows], {int(row[0]): square(row[1:]) for row in rows}
        self.to_body = read_rows(os.path.join(self.calibration, "calib_cam_to_pose.txt"),
                                 {f"image_0{i}": 12 for i in range(4)})
        path = os.path.join(self.calibration, "calib_cam_to_velo.txt")
        self.lidar_to_body = square(self.to_body["image_00"]) @ np.linalg.inv(square(read_numbers(path, read_text(path),
                                                                                                 12)))
        self.raw, self.clouds = (os.path.join(folder, kind, name) for kind in ("data_2d_raw", "data_3d_raw"))
        self.semantics = os.path.join(folder, "data_2d_semantics", "train", name)
        self.times = self._times_of(os.path.join(self.clouds, "velodyne_points"))
        self.turn = float(np.median(np.diff(self.times))) if len(self.times) > 1 else TURN
        self.motion = Motion(self.times[self.numbers], [self.poses[n] @ self.lidar_to_body for n in self.numbers])
        self.files = [self.poses_path, *sorted(glob.glob(os.path.join(self.calibration, "*")))]

    def _times_of(self, folder):
        path = os.path.join(folder, "timestamps.txt")
        times = read_times(path)
        if len(times) <= self.numbers[-1]:
            raise SystemExit(f"{path}: expected a time for each frame up to {self.numbers[-1]}, found {len(times)}")
        return times

    def camera_names(self):
        return sorted(name for name in os.listdir(existing(self.raw)) if re.fullmatch(r"image_0[0-3]", name))

    def camera(self, name, numbers):
        folder, upright = os.path.join(self.raw, name), name in ("image_00", "image_01")
        lens, turned = self._perspective(name[-2:]) if upright else (self._fisheye(name), np.eye(4))
        to_body, times, pictures = square(self.to_body[name]) @ turned, self._times_of(folder), []
        for n in numbers:
            path = existing(os.path.join(folder, "data_rect" if upright else "data_rgb", f"{n:010d}.png"))
            label = os.path.join(self.semantics, name, "semantic", f"{n:010d}.png")
            labels = (lambda label=label: read_label_picture(label)) if os.path.exists(label) else None
            self.files += [path, label]
            pictures.append(Picture(times[n], self.poses[n] @ to_body, path, f"{n:010d}",
                                    lambda path=path: read_picture(path), labels))
        return Camera(name, lens, pictures)

    def _perspective(self, number):
        """lens, and the rotation from the rectified camera to that of the calibration"""
        path = os.path.join(self.calibration, "perspective.txt")
        rows = read_rows(path, {f"P_rect_{number}": 12, f"R_rect_{number}": 9, f"S_rect_{number}": 2})
        p = rows[f"P_rect_{number}"].reshape(3, 4)
        width, height = (int(side) for side in rows[f"S_rect_{number}"])
        return (OpenCv(width, height, p[0, 0], p[1, 1], p[0, 2] + FIRST_PIXEL, p[1, 2] + FIRST_PIXEL),
                rigid([0, 0, 0], rows[f"R_rect_{number}"].reshape(3, 3).T))

    def _fisheye(self, name):
        path = os.path.join(self.calibration, name + ".yaml")
        values = dict(re.findall(r"(\w+)\s*:\s*([-+.\deE]+)\s*$", read_text(path), re.MULTILINE))
        missing = [key for key in ("image_width", "image_height", *MEI_FIELDS) if key not in values]
        if missing:
            raise SystemExit(f"{path}: {missing[0]} is missing")
        lens = Mei(int(values["image_width"]), int(values["image_height"]), *(float(values[key]) for key in MEI_FIELDS))
        return lens._replace(u0=lens.u0 + FIRST_PIXEL, v0=lens.v0 + FIRST_PIXEL)

    def sweep(self, number):
        path = existing(os.path.join(self.clouds, "velodyne_points", "data", f"{number:010d}.bin"))
        self.files.append(path)
        ahead = self.times[number]
        begin_time, end_time = ahead - self.turn / 2, ahead + self.turn / 2
        begin, end = self.motion.at([begin_time, end_time])

        def points():
            raw = read_floats(path, 4).astype(float)
            azimuth = np.arctan2(raw[:, 1], raw[:, 0])
            seen = np.abs(azimuth) < np.pi - SEAM
            raw, share = raw[seen], 0.5 - azimuth[seen] / (2 * np.pi)
            in_world = transformed(Motion([0, 1], [begin, end]).at(share), raw[:, :3])
            return points_of(transformed(np.linalg.inv(end), in_world), raw[:, 3], 0, share * self.turn * 1e6)

        return Sweep(begin_time, end_time, begin, end, ahead, points)

    def tracks(self):
        """of what is annotated as moving, frame by frame"""
        found = [path for part in ("train", "train_full", "test")
                 for path in glob.glob(os.path.join(self.folder, "data_3d_bboxes", part, self.name + ".xml"))]
        if not found:
            print(f"{self.folder}: no data_3d_bboxes of {self.name}: what moves stays in", flush=True)
            return []
        self.files.append(found[0])
        things = {}
        for box in parse_xml(found[0]):
            frame = int(text_of(found[0], box, "timestamp")) if box.find("transform") is not None else -1
            if 0 <= frame < len(self.times):
                key = text_of(found[0], box, "semanticId"), text_of(found[0], box, "instanceId")
                things.setdefault(key, []).append((self.times[frame], *read_box(found[0], box)))
        return [track_of(seen, self.turn) for seen in things.values()]


def parse_xml(path):
    try:
        return ET.parse(path).getroot()
    except ET.ParseError as error:
        raise SystemExit(f"{path}: broken XML: {error}") from error


def text_of(path, node, name):
    found = node.find(name)
    if found is None or found.text is None:
        raise SystemExit(f"{path}: {name} is missing in {node.tag}")
    return found.text


def read_matrix(path, node, name):
    of = node.find(name)
    if of is None:
        raise SystemExit(f"{path}: {name} is missing in {node.tag}")
    rows, columns = (int(text_of(path, of, side)) for side in ("rows", "cols"))
    return read_numbers(path, text_of(path, of, "data"), rows * columns).reshape(rows, columns)


def read_box(path, node):
    """-> pose, size: the transform has the size in its axes, or the vertices have"""
    transform, vertices = read_matrix(path, node, "transform"), read_matrix(path, node, "vertices")
    low, high = vertices.min(0), vertices.max(0)
    scale = np.linalg.norm(transform[:3, :3], axis=0)
    middle = transform[:3, :3] @ ((low + high) / 2) + transform[:3, 3]
    return rigid(middle, transform[:3, :3] / scale), (high - low) * scale

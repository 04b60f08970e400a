# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A drive as `semrover render --rig --boxes` writes it (docs/formats.md §6.3, §6.5, §6.6, §6.8), to make logs of."""
import json
import os
from typing import NamedTuple

import numpy as np

from .import_drive import OPENGL
from .motion import rigid
from .source import existing, field, read_json


class Frame(NamedTuple):
    time: float
    pose: np.ndarray  # OpenCV's axes
    color: str
    label: str


class Box(NamedTuple):
    time: float
    pose: np.ndarray


class Scan(NamedTuple):
    time: float
    duration: float
    begin: np.ndarray
    end: np.ndarray
    path: str

    def points(self):
        return np.load(self.path)


class Rendered:
    """cameras: {name: (sensor of the rig, [Frame])}; scans: [Scan]; things: {id: (class, size, [Box])}, of each time
    that some camera sees them; lidar_to_vehicle; poses: [(time, pose)] of the vehicle"""

    def __init__(self, folder):
        self.folder = folder
        rig = field(folder, read_json(os.path.join(folder, "calibration.json"), dict), "rig")["sensors"]
        lidars = [s for s in rig if "lidar" in s]
        if not lidars:
            raise SystemExit(f"{folder}: a drive without a lidar; give `render` a rig that has one")
        self.cameras = {s["name"]: (s, []) for s in rig if "lidar" not in s}
        for f in read_json(os.path.join(folder, "transforms.json"), dict)["frames"]:
            self.cameras[f["camera"]][1].append(
                Frame(f["time"], np.array(f["transform_matrix"]) @ OPENGL,
                      *(os.path.join(folder, f[kind]) for kind in ("file_path", "label_file_path"))))
        self.lidar_to_vehicle = np.array(lidars[0]["sensor_to_vehicle"])
        self.scans = self._scans(os.path.join(folder, lidars[0]["name"]))
        self.things = self._things()
        self.poses = [(p["time"] * 1e-6, rigid(p["position"], np.roll(p["rotation"], 1)))
                      for p in self._lines("ego_pose.jsonl")]

    def _lines(self, name):
        with open(existing(os.path.join(self.folder, name))) as file:
            return [json.loads(line) for line in file]

    def _scans(self, folder):
        sweeps = read_json(os.path.join(folder, "sweeps.json"), dict)["sweeps"]
        return [Scan(s["time"] * 1e-6, s["duration"] * 1e-6, np.array(s["begin"]), np.array(s["end"]),
                     existing(os.path.join(folder, "points", f"{n:06d}.npy"))) for n, s in enumerate(sweeps)]

    def _things(self):
        things = {}
        for line in self._lines("boxes.jsonl"):
            for box in line["objects"]:
                seen = things.setdefault(box["id"], (box["class"], box["size"], {}))[2]
                world = box["world"]
                seen[line["time"]] = Box(line["time"] * 1e-6, rigid(world["center"], np.roll(world["rotation"], 1)))
        return {i: (name, size, [seen[t] for t in sorted(seen)]) for i, (name, size, seen) in things.items()}

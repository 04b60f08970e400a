# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Scenes of nuScenes v1.0, as the schema of github.com/nutonomy/nuscenes-devkit says. Pictures are undistorted. Points
are as they lie at the sweep's time, its end, and have no times of their own."""
import glob
import os

import numpy as np

from .boxes import track_of
from .label_table import NOTHING, LabelTable
from .lens import OpenCv
from .log import Camera, Log, Picture, Sweep, points_of
from .motion import Motion, rigid, transformed
from .source import existing, field, read_floats, read_json, read_picture, same_counts

LIDAR = "LIDAR_TOP"
EVERY = 0.5    # seconds between annotations
TURN = 0.05    # seconds of a sweep, where only one is there
APART = 60000  # microseconds by which pictures of a sample may be before or behind its sweep


def is_here(folder):
    return bool(glob.glob(os.path.join(folder, "v1.0-*", "scene.json")))


def read(folder, scene=None, frames=None):
    return Scene(folder, scene).log(frames)


class Scene:
    def __init__(self, folder, name):
        found = sorted(glob.glob(os.path.join(folder, "v1.0-*", "scene.json")))
        scenes = [(os.path.dirname(path), s) for path in found for s in read_json(path)]
        of_name = [(at, s) for at, s in scenes if name is None or s["name"] == name]
        if len(of_name) != 1:
            raise SystemExit(f"{folder}: --scene says which of {', '.join(s['name'] for _, s in scenes)[:400]}")
        self.folder, (self.tables, scene) = folder, of_name[0]
        self.samples = sorted((s for s in self._table("sample") if s["scene_token"] == scene["token"]),
                              key=lambda s: s["timestamp"])
        tokens = {s["token"] for s in self.samples}
        data = [d for d in self._table("sample_data") if d["sample_token"] in tokens]
        self.mounts = {m["token"]: m for m in self._table("calibrated_sensor")}
        sensors = {s["token"]: s["channel"] for s in self._table("sensor")}
        wanted = {d["ego_pose_token"] for d in data}
        self.vehicle = {p["token"]: rigid(p["translation"], p["rotation"]) for p in self._table("ego_pose")
                        if p["token"] in wanted}
        self.channels = {}
        for d in sorted(data, key=lambda d: d["timestamp"]):
            mount = self._of(self.mounts, d["calibrated_sensor_token"], "calibrated_sensor")
            self.channels.setdefault(self._of(sensors, mount["sensor_token"], "sensor"), []).append(d)
        if LIDAR not in self.channels:
            raise SystemExit(f"{self._path('sample_data')}: no {LIDAR} of {scene['name']}")

    def _path(self, table):
        return os.path.join(self.tables, table + ".json")

    def _table(self, name):
        return read_json(self._path(name))

    def _of(self, records, token, table):
        if token not in records:
            raise SystemExit(f"{self._path(table)}: no record {token}, which another table names")
        return records[token]

    def log(self, frames):
        first, last = frames or (0, len(self.samples) - 1)
        if not 0 <= first <= last < len(self.samples):
            raise SystemExit(f"{self._path('sample')}: frames are samples 0 to {len(self.samples) - 1}, not {frames}")
        begin = self.samples[first]["timestamp"] - APART if frames else -np.inf
        end = self.samples[last]["timestamp"] + APART if frames else np.inf
        chosen = {channel: [d for d in data if begin <= d["timestamp"] <= end]
                  for channel, data in sorted(self.channels.items()) if channel == LIDAR or channel.startswith("CAM_")}
        files = [existing(os.path.join(self.folder, d["filename"])) for data in chosen.values() for d in data]
        cameras = [self._camera(channel, data) for channel, data in chosen.items() if channel != LIDAR and data]
        segmented = self._segmented()
        return Log(cameras, self._sweeps(chosen[LIDAR], segmented), self._tracks(),
                   files + [segmented[d["token"]] for d in chosen[LIDAR] if d["token"] in segmented])

    def _pose(self, d):
        mount = self.mounts[d["calibrated_sensor_token"]]
        return self._of(self.vehicle, d["ego_pose_token"], "ego_pose") @ rigid(mount["translation"], mount["rotation"])

    def _camera(self, channel, data):
        mount = self.mounts[data[0]["calibrated_sensor_token"]]
        k = np.array(field(self._path("calibrated_sensor"), mount, "camera_intrinsic"), float)
        lens = OpenCv(data[0]["width"], data[0]["height"], k[0, 0], k[1, 1], k[0, 2], k[1, 2])
        paths = [os.path.join(self.folder, d["filename"]) for d in data]
        return Camera(channel, lens, [
            Picture(d["timestamp"] * 1e-6, self._pose(d), path, os.path.splitext(os.path.basename(path))[0],
                    lambda path=path: read_picture(path)) for d, path in zip(data, paths)])

    def _segmented(self):
        """{token of sample_data: file} of nuScenes-lidarseg, where it is there"""
        if not os.path.exists(self._path("lidarseg")):
            return {}
        own = {d["token"] for d in self.channels[LIDAR]}
        return {r["sample_data_token"]: existing(os.path.join(self.folder, r["filename"]))
                for r in self._table("lidarseg") if r["sample_data_token"] in own}

    def _sweeps(self, data, segmented):
        times = [d["timestamp"] * 1e-6 for d in self.channels[LIDAR]]
        forward = quarter_turn(self.mounts[data[0]["calibrated_sensor_token"]])
        motion = Motion(times, [self._pose(d) @ np.linalg.inv(forward) for d in self.channels[LIDAR]])
        turn = float(np.median(np.diff(times))) if len(times) > 1 else TURN
        return [self._sweep(d, motion, turn, forward, segmented.get(d["token"])) for d in data]

    def _sweep(self, d, motion, turn, forward, labels):
        time, path = d["timestamp"] * 1e-6, os.path.join(self.folder, d["filename"])
        begin, end = motion.at([time - turn, time])

        def points():
            p = read_floats(path, 5)
            label = NOTHING
            if labels:
                classes = np.fromfile(labels, np.uint8)
                same_counts(labels, {"labels": len(classes), "points": len(p)})
                label = LabelTable("nuscenes")(classes, labels)
            return points_of(transformed(forward, p[:, :3].astype(float)), p[:, 3] / 255, p[:, 4], turn * 1e6, label)

        return Sweep(time - turn, time, begin, end, time, points)

    def _tracks(self):
        """sizes are width, length, height"""
        times, found = {s["token"]: s["timestamp"] * 1e-6 for s in self.samples}, {}
        for a in self._table("sample_annotation"):
            if a["sample_token"] in times:
                w, l, h = a["size"]
                found.setdefault(a["instance_token"], []).append(
                    (times[a["sample_token"]], rigid(a["translation"], a["rotation"]), (l, w, h)))
        return [track_of(seen, EVERY) for seen in found.values()]


def quarter_turn(mount):
    """lidars' axes differ: the turn about z after which x looks the most ahead"""
    turns = [rigid([0, 0, 0], [np.cos(angle / 2), 0, 0, np.sin(angle / 2)]) for angle in np.arange(4) * np.pi / 2]
    to_vehicle = rigid(mount["translation"], mount["rotation"])
    return max(turns, key=lambda turn: (to_vehicle @ np.linalg.inv(turn))[0, 0])

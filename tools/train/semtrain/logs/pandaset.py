# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""PandaSet's sequences, as its devkit reads them: github.com/scaleapi/pandaset-devkit, python/pandaset/sensors.py and
annotations.py. Points are in the world, with a time each. intrinsics.json has no distortion and the devkit projects
without one; a key `distortion`, k1 k2 p1 p2 k3, that somebody adds to it is taken."""
import glob
import os
import pickle

import numpy as np

from .boxes import track_of
from .label_table import NOTHING, LabelTable
from .lens import OpenCv
from .log import Camera, Log, Picture, Sweep, chosen, points_of
from .motion import Motion, rigid, transformed
from .source import existing, field, read_json, read_picture, same_counts

SPINNING = 0      # of a point's `d`: the lidar on the roof. 1 looks forward, from a place that no file says
EVERY = 0.1       # seconds between annotations
FIRST_PIXEL = 0.5  # cx and cy count from its centre (assets/rigs/README.md)
# x right, y forward -> x forward, y left
LIDAR_AXES = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def is_here(folder):
    return os.path.exists(os.path.join(folder, "lidar", "poses.json")) and os.path.isdir(os.path.join(folder, "camera"))


def read(folder, scene=None, frames=None):
    lidar, cuboids = (os.path.join(folder, name) for name in ("lidar", "annotations/cuboids"))
    times, poses = read_poses(lidar)
    count = len(times)
    files = [existing(frame_path(lidar, n)) for n in range(count)]
    same_counts(folder, {"poses of the lidar": count, "clouds": len(glob.glob(os.path.join(lidar, "*.pkl.gz"))),
                         "tables of cuboids": len(glob.glob(os.path.join(cuboids, "*.pkl.gz")))})
    labels = os.path.join(folder, "annotations", "semseg")
    labels = labels if os.path.isdir(labels) else None
    motion, numbers = Motion(times, [pose @ np.linalg.inv(LIDAR_AXES) for pose in poses]), chosen(frames, range(count))
    cameras = [read_camera(path, count, numbers) for path in sorted(glob.glob(os.path.join(folder, "camera", "*", "")))]
    return Log(cameras, [read_sweep(files[n], n, times[n], motion, labels) for n in numbers],
               read_tracks(cuboids, times), [files[n] for n in numbers] + sorted(glob.glob(os.path.join(cuboids, "*"))))


def frame_path(folder, number):
    return os.path.join(folder, f"{number:02d}.pkl.gz")


def read_poses(folder):
    """-> seconds [N], poses [N, 4, 4] of poses.json and timestamps.json"""
    path = os.path.join(folder, "poses.json")
    entries, times = read_json(path), read_json(os.path.join(folder, "timestamps.json"))
    same_counts(folder, {"poses": len(entries), "times": len(times)})
    poses = []
    for entry in entries:
        position, heading = field(path, entry, "position"), field(path, entry, "heading")
        poses.append(rigid([float(field(path, position, k)) for k in "xyz"],
                           [float(field(path, heading, k)) for k in "wxyz"]))
    return np.array(times, float), np.array(poses)


def read_camera(folder, count, numbers):
    folder = folder.rstrip(os.sep)
    times, poses = read_poses(folder)
    paths = sorted(glob.glob(os.path.join(folder, "*.jpg")))
    same_counts(folder, {"pictures": len(paths), "poses": len(poses), "sweeps": count})
    path = os.path.join(folder, "intrinsics.json")
    intrinsics = read_json(path, dict)
    height, width = read_picture(paths[0]).shape[:2]
    fx, fy, cx, cy = (float(field(path, intrinsics, k)) for k in ("fx", "fy", "cx", "cy"))
    lens = OpenCv(width, height, fx, fy, cx + FIRST_PIXEL, cy + FIRST_PIXEL, tuple(intrinsics.get("distortion", ())))
    return Camera(os.path.basename(folder), lens, [
        Picture(times[n], poses[n], paths[n], os.path.basename(paths[n])[:-4], lambda n=n: read_picture(paths[n]))
        for n in numbers])


def read_frame(path, columns):
    """a pandas.DataFrame that has these columns"""
    import pandas
    try:
        frame = pandas.read_pickle(existing(path))
    except (OSError, EOFError, pickle.UnpicklingError, ValueError, AttributeError, ImportError) as error:
        raise SystemExit(f"{path}: not a whole table of pandas: {error}") from error
    missing = [name for name in columns if name not in getattr(frame, "columns", ())]
    if missing:
        raise SystemExit(f"{path}: columns are missing: {', '.join(missing)}")
    return frame


def read_sweep(path, number, time, motion, labels):
    cloud = read_frame(path, ("x", "y", "z", "i", "t", "d"))
    spinning = cloud["d"].to_numpy() == SPINNING
    moments = cloud["t"].to_numpy()[spinning]
    if not len(moments):
        raise SystemExit(f"{path}: no points of the lidar on the roof")
    begin_time, end_time = float(moments.min()), float(moments.max())
    begin, end = motion.at([begin_time, end_time])

    def points():
        of_path = read_frame(path, ("x", "y", "z", "i", "t", "d"))
        label = NOTHING
        if labels:
            file = frame_path(labels, number)
            classes = read_frame(file, ("class",))["class"].to_numpy().astype(int)
            same_counts(file, {"labels": len(classes), "points": len(of_path)})
            label = LabelTable("pandaset")(classes[spinning], file)
        xyz = of_path[["x", "y", "z"]].to_numpy()[spinning]
        return points_of(transformed(np.linalg.inv(end), xyz), of_path["i"].to_numpy()[spinning] / 255, 0,
                         (moments - begin_time) * 1e6, label)

    return Sweep(begin_time, end_time, begin, end, time, points)


def read_tracks(folder, times):
    """yaw is 0 along y, and y is the length; ours is along x"""
    found, names = {}, [f"position.{k}" for k in "xyz"] + [f"dimensions.{k}" for k in "yxz"]
    for number, time in enumerate(times):
        frame = read_frame(frame_path(folder, number), ("uuid", "yaw", *names))
        for uuid, yaw, *box in frame[["uuid", "yaw", *names]].itertuples(index=False):
            s, c = np.sin(float(yaw)), np.cos(float(yaw))
            pose = rigid(box[:3], np.array([[-s, -c, 0], [c, -s, 0], [0, 0, 1]]))
            found.setdefault(uuid, []).append((time, pose, box[3:]))
    return [track_of(seen, EVERY) for seen in found.values()]

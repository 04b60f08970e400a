# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A rendered drive as a sequence of PandaSet (pandaset.py says where its layout is from)."""
import os

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from ..json_file import write_json
from .label_table import LabelTable
from .motion import transformed
from .pandaset import FIRST_PIXEL, LIDAR_AXES, SPINNING, frame_path

EPOCH = 1557539924.0  # seconds: times of logs are large numbers
OTHER = 42            # "Other Static Object", for classes that PandaSet has not
NAMES = {"car": "Car", "truck": "Medium-sized Truck", "bus": "Bus", "train": "Tram / Subway",
         "motorcycle": "Motorcycle", "bicycle": "Bicycle", "person": "Pedestrian", "rider": "Personal Mobility Device",
         "traffic sign": "Signs"}


def write(drive, output, number):
    folder = os.path.join(output, f"{number + 1:03d}")
    for name, (sensor, frames) in drive.cameras.items():
        if sensor["model"] == "pinhole":  # PandaSet has no others
            write_camera(os.path.join(folder, "camera", name + "_camera"), sensor, frames)
    write_lidar(drive, folder)
    write_cuboids(drive, os.path.join(folder, "annotations", "cuboids"))


def write_poses(folder, poses, times):
    """poses.json and timestamps.json"""
    entries = []
    for pose in poses:
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        entries.append({"position": dict(zip("xyz", map(float, pose[:3, 3]))),
                        "heading": {"w": w, "x": x, "y": y, "z": z}})
    write_json(os.path.join(folder, "poses.json"), entries)
    write_json(os.path.join(folder, "timestamps.json"), [EPOCH + time for time in times])


def write_camera(folder, sensor, frames):
    os.makedirs(folder)
    for number, frame in enumerate(frames):
        picture = Image.open(frame.color).convert("RGB")
        picture.save(os.path.join(folder, f"{number:02d}.jpg"), quality=95, subsampling=0)
    write_poses(folder, [f.pose for f in frames], [f.time for f in frames])
    write_json(os.path.join(folder, "intrinsics.json"), {
        "fx": sensor["fx"], "fy": sensor["fy"], "cx": sensor["cx"] - FIRST_PIXEL, "cy": sensor["cy"] - FIRST_PIXEL})


def write_lidar(drive, folder):
    import pandas
    lidar, labels = os.path.join(folder, "lidar"), os.path.join(folder, "annotations", "semseg")
    table = LabelTable("pandaset")
    numbers = table.first_numbers(OTHER)
    for path in (lidar, labels):
        os.makedirs(path)
    for number, scan in enumerate(drive.scans):
        p = scan.points().astype(float)
        cloud = pandas.DataFrame(transformed(scan.end, p[:, :3]), columns=list("xyz"))
        cloud["i"], cloud["t"], cloud["d"] = p[:, 3] * 255, EPOCH + scan.time - scan.duration + p[:, 5] * 1e-6, SPINNING
        cloud.index.name = "index"
        cloud.to_pickle(frame_path(lidar, number))
        classes = pandas.DataFrame({"class": numbers[p[:, 6].astype(int)].astype(int)})
        classes.index.name = "index"
        classes.to_pickle(frame_path(labels, number))
    write_poses(lidar, [scan.end @ LIDAR_AXES for scan in drive.scans], [scan.time for scan in drive.scans])
    write_json(os.path.join(labels, "classes.json"), {str(n): name for n, name in table.names.items()})


def write_cuboids(drive, folder):
    """a table a sweep, of what cameras see at its time"""
    import pandas
    os.makedirs(folder)
    for number, scan in enumerate(drive.scans):
        rows = [row for thing, (name, size, boxes) in drive.things.items() if name in NAMES
                for row in cuboids(thing, name, size, boxes, scan.time)]
        pandas.DataFrame(rows, columns=("uuid", "label", "yaw", "stationary", "camera_used", "position.x", "position.y",
                                        "position.z", "dimensions.x", "dimensions.y", "dimensions.z",
                                        "attributes.object_motion", "cuboids.sibling_id", "cuboids.sensor_id",
                                        "attributes.rider_status", "attributes.pedestrian_behavior",
                                        "attributes.pedestrian_age")).to_pickle(frame_path(folder, number))


def cuboids(thing, name, size, boxes, time):
    """yaw is of the length, counted from y; widths are along x"""
    moves = any(np.abs(box.pose[:3, 3] - boxes[0].pose[:3, 3]).max() > 0.01 for box in boxes)
    for box in boxes:
        if abs(box.time - time) < 1e-6:
            yaw = float(np.arctan2(box.pose[1, 0], box.pose[0, 0]) - np.pi / 2)
            yield (f"{thing:08x}-0000-4000-8000-000000000000", NAMES[name], yaw, not moves, -1, *box.pose[:3, 3],
                   size[1], size[0], size[2], "Moving" if moves else "Parked", "", -1, "", "", "")

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""nuScenes-lidarseg beside what `semrover dataset export --to nuscenes` wrote: classes of the key frames' points."""
import os

from ..json_file import write_json
from .label_table import LabelTable
from .nuscenes import LIDAR
from .source import read_json

TABLES = "v1.0-trainval"


def add_lidarseg(drives, folder):
    scenes = read_json(os.path.join(folder, TABLES, "scene.json"))
    scene_of = {s["token"]: s["scene_token"] for s in read_json(os.path.join(folder, TABLES, "sample.json"))}
    data = [d for d in read_json(os.path.join(folder, TABLES, "sample_data.json")) if f"/{LIDAR}/" in d["filename"]]
    numbers, records = LabelTable("nuscenes").first_numbers(0), []
    os.makedirs(os.path.join(folder, "lidarseg", TABLES))
    for scene, drive in zip(scenes, drives):
        own = [d for d in data if scene_of[d["sample_token"]] == scene["token"]]
        for d, scan in zip(sorted(own, key=lambda d: d["timestamp"]), drive.scans):
            if d["is_key_frame"]:
                file = f"lidarseg/{TABLES}/{d['token']}_lidarseg.bin"
                numbers[scan.points()[:, 6].astype(int)].tofile(os.path.join(folder, file))
                records.append({"token": d["token"], "sample_data_token": d["token"], "filename": file})
    write_json(os.path.join(folder, TABLES, "lidarseg.json"), records)

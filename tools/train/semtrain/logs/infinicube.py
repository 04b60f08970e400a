# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Clips of InfiniCube's WebDataset, archives ATTRIBUTE/CLIP.tar: github.com/nv-tlabs/InfiniCube,
infinicube/data_process/waymo2webdataset.py and generate_additional_attributes.py. It has depth in place of a lidar."""
import io
import json
import os
import re
import tarfile

import numpy as np

from ..pictures import Picture as Member
from .boxes import track_of
from .lens import OpenCv
from .log import Camera, Log, Picture, chosen
from .source import existing, field, read_label_picture, read_picture, same_counts

EVERY = 0.1            # seconds a frame: clips have no times, and Waymo's are of 10 Hz
UNITS = 100            # of depth, a metre
RESOLUTION = r"(?:_[0-9]+p)?"  # attributes that InfiniCube makes say how many rows they have


def is_here(folder):
    path = os.path.join(folder, "pose")
    return os.path.isdir(path) and any(name.endswith(".tar") for name in os.listdir(path))


def read(folder, scene=None, frames=None):
    clips = sorted(name[:-4] for name in os.listdir(os.path.join(folder, "pose")) if name.endswith(".tar"))
    if scene is None and len(clips) != 1:
        raise SystemExit(f"{folder}: --scene says which of {', '.join(clips)[:400]}")
    clip = Clip(folder, scene or clips[0])
    names = sorted(name[6:] for name in os.listdir(folder) if re.fullmatch(r"image_[a-z_]+", name))
    if not names:
        raise SystemExit(f"{folder}: no image_CAMERA")
    return Log([clip.camera(name, frames) for name in names], [], clip.tracks(), list(dict.fromkeys(clip.files)),
               "waymo")


class Clip:
    def __init__(self, folder, name):
        self.folder, self.name, self.files = folder, name, []

    def members(self, attribute):
        """{field: Member} of an archive, fields without the clip's name"""
        path = existing(os.path.join(self.folder, attribute, self.name + ".tar"))
        self.files.append(path)
        try:
            with tarfile.open(path) as archive:
                return {m.name[len(self.name) + 1:]: Member(path, m.offset_data, m.size) for m in archive if m.isfile()}
        except (tarfile.TarError, EOFError) as error:
            raise SystemExit(f"{path}: not a whole archive: {error}") from error

    def attribute(self, kind, camera):
        """the members of KIND_CAMERA or KIND_480p_CAMERA, {} where it is not there"""
        found = [name for name in sorted(os.listdir(self.folder)) if re.fullmatch(f"{kind}{RESOLUTION}_{camera}", name)
                 and os.path.exists(os.path.join(self.folder, name, self.name + ".tar"))]
        return self.members(found[0]) if found else {}

    def camera(self, name, frames):
        intrinsic = self._array("intrinsic", f"intrinsic.{name}.npy", (6,))
        lens = OpenCv(int(intrinsic[4]), int(intrinsic[5]), *intrinsic[:4])
        images, poses = self.members(f"image_{name}"), self.members("pose")
        others = {kind: self.attribute(kind, name) for kind in ("semantic_buffer", "skymask", "voxel_depth_100")}
        numbers = sorted(int(key[:6]) for key in images if re.fullmatch(rf"[0-9]{{6}}\.image\.{name}\.jpg", key))
        same_counts(f"{self.folder}: {name}", {"pictures": len(numbers),
                                               "poses": sum(f".pose.{name}." in key for key in poses)})
        pictures = []
        for n in chosen(frames, numbers):
            image, key = images[f"{n:06d}.image.{name}.jpg"], f"{n:06d}.{{}}.{name}.png"
            of = {kind: members.get(key.format(kind)) for kind, members in others.items()}
            pictures.append(Picture(
                n * EVERY, self._array("pose", f"{n:06d}.pose.{name}.npy", (4, 4), poses), image.file, f"{n:06d}",
                lambda image=image: read_picture(image.file, io.BytesIO(image.read())),
                numbers_of(of["semantic_buffer"]), numbers_of(of["skymask"]), metres_of(of["voxel_depth_100"])))
        return Camera(name, lens, pictures)

    def _array(self, attribute, key, shape, members=None):
        members = members or self.members(attribute)
        path = os.path.join(self.folder, attribute, self.name + ".tar")
        if key not in members:
            raise SystemExit(f"{path}: {key} is missing")
        try:
            values = np.load(io.BytesIO(members[key].read()))
        except (ValueError, EOFError) as error:
            raise SystemExit(f"{path}: {key}: {error}") from error
        if values.shape != shape:
            raise SystemExit(f"{path}: {key}: expected {shape}, found {values.shape}")
        return values.astype(float)

    def tracks(self):
        """of static_object_info and dynamic_object_info, a member a frame"""
        found = {}
        for attribute in ("static_object_info", "dynamic_object_info"):
            if not os.path.exists(os.path.join(self.folder, attribute, self.name + ".tar")):
                continue
            for key, member in sorted(self.members(attribute).items()):
                for thing, about in parse(member, key).items():
                    pose = np.array(field(member.file, about, "object_to_world"), float)
                    seen = int(key[:6]) * EVERY, pose, field(member.file, about, "object_lwh")
                    found.setdefault(thing, []).append(seen)
        return [track_of(seen, EVERY) for seen in found.values()]


def parse(member, key):
    try:
        return json.loads(member.read())
    except ValueError as error:
        raise SystemExit(f"{member.file}: {key}: broken JSON: {error}") from error


def numbers_of(member):
    return member and (lambda: read_label_picture(member.file, io.BytesIO(member.read())))


def metres_of(member):
    return member and (lambda: read_label_picture(member.file, io.BytesIO(member.read())) / UNITS)

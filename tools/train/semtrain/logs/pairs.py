# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The steps from a Log to pairs, in folders that say in made_of.json what they were made of."""
import hashlib
import os
import shutil

import numpy as np
from PIL import Image

from ..content import digest, keep_made_of
from ..drives import DONE, make_buffers
from ..json_file import read_json
from ..program import semrover
from .import_drive import write_drive
from .label_table import SKY


class Pairs:
    def __init__(self, output, log, options):
        self.log, self.options = log, options
        self.drive, self.scene = (os.path.join(output, name) for name in ("drive", "scene"))
        self.visible = self._visible()

    def _visible(self):
        """what buffer/visible says: "sky" or "splats" """
        pictures = [picture for camera in self.log.cameras for picture in camera.pictures]
        bare = 0 if self.options.labels else sum(not (picture.labels or picture.sky) for picture in pictures)
        if bare and self.options.visible == "sky":
            raise SystemExit(f"{bare} of {len(pictures)} pictures have no labels that tell their sky: --labels, --cameras, "
                             "--frames, or --visible splats")
        return self.options.visible or ("splats" if bare else "sky")

    def import_drive(self):
        """OUT/drive but its buffers"""
        o, cameras = self.options, [camera.name for camera in self.log.cameras]
        about = {"log": digest(self.log.files + self._labels(), state_of(self.log)), "cameras": cameras,
                 "frames": o.frames and list(o.frames), "size": [o.width, o.height], "map": o.map}
        step(self.drive, about, lambda: write_drive(self.log, self.drive, (o.width, o.height), o.labels, o.map))

    def _labels(self):
        return [os.path.join(self.options.labels, camera.name, picture.name + ".png")
                for camera in self.log.cameras for picture in camera.pictures] if self.options.labels else []

    def fuse(self):
        """OUT/scene"""
        exclude = ["--exclude", self.options.exclude] if self.options.exclude else []
        about = {"drive": digest([os.path.join(self.drive, "made_of.json")]), "exclude": self.options.exclude}
        step(self.scene, about, lambda: semrover("fuse", self.drive, "-o", self.scene, *exclude))

    def draw_buffers(self):
        """OUT/drive/buffer: splats, and what of a picture is not sky"""
        o, buffer = self.options, os.path.join(self.drive, "buffer")
        print(f"{buffer}: visible is {'what is not sky' if self.visible == 'sky' else 'where splats are'}", flush=True)
        grid = os.path.join(self.scene, "voxfield.sgrid")
        about = {"grid": digest([grid]), "splat_radius": o.splat_radius, "visible": self.visible}

        def draw():
            make_buffers(grid, self.drive, self.drive, (o.width, o.height), o.splat_radius)
            if self.visible == "sky":
                put_sky(self.drive, buffer, read_json(os.path.join(self.drive, "transforms.json"))["frames"])

        step(buffer, about, draw)


def step(folder, about, make):
    """FOLDER once, whole or again; another's folder is left alone"""
    if os.path.exists(os.path.join(folder, DONE)):
        keep_made_of(folder, about)
        return
    ours = [os.path.join(folder, "made_of.json"), os.path.join(os.path.dirname(folder), DONE)]
    if os.path.isdir(folder) and os.listdir(folder) and not any(map(os.path.exists, ours)):
        raise SystemExit(f"{folder} is there, and not of this recipe: name another -o")
    shutil.rmtree(folder, ignore_errors=True)
    keep_made_of(folder, about)
    make()
    keep_made_of(folder, about)
    with open(os.path.join(folder, DONE), "w"):
        pass
    print(folder, flush=True)


def state_of(log):
    """key of its numbers: lenses, poses, times, boxes"""
    total = hashlib.sha256(repr([(c.name, c.lens, [(p.time, p.name) for p in c.pictures]) for c in log.cameras]
                                + [(s.begin_time, s.end_time, s.boxes_time) for s in log.sweeps]).encode())
    arrays = [p.pose for c in log.cameras for p in c.pictures] + [of for s in log.sweeps for of in (s.begin, s.end)]
    for array in arrays + [of for t in log.tracks for of in (t.size, t.motion.times, t.motion.poses)]:
        total.update(np.ascontiguousarray(array, float).tobytes())
    return total.hexdigest()


def put_sky(drive, buffer, frames):
    """the pictures of buffer/visible become 0 where a label says sky; what has no label is not sky"""
    for frame in frames:
        camera, _, name = frame["label_file_path"].rpartition("label/")
        labels = np.array(Image.open(os.path.join(drive, frame["label_file_path"])))
        Image.fromarray(np.where(labels == SKY, 0, 255).astype(np.uint8)).save(
            os.path.join(buffer, camera, "visible", name))

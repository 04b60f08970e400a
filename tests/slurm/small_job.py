# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A job of small scenes, each with a drive of three splat frames, and what came of it."""
import hashlib
import json
import os
import pathlib
import struct
import subprocess

SEMROVER = os.environ["SEMROVER"]
SOURCES = pathlib.Path(__file__).resolve().parents[2]
MODEL = SOURCES / "tests/golden/sampling_ddpm/model"  # two layers

JOB = """\
out = "out"
model = "{model}"
seed = 7
[[scene]]
labels = "scenes/*.sgrid"
[[drive]]
path = "ahead.tum"
width = 56
height = 40
[generate]
steps = {steps}
region_size = 24
coverage_threshold = 6
"""


def write_labels(path, wall, length):
    """a road of `length` x 5 voxels and a wall beside it"""
    cells = [(i, j, int(j == 5)) for i in range(length) for j in range(6)]
    places = b"".join(struct.pack("<3i", *cell) for cell in cells)
    labels = bytes(wall if cell[2] else 0 for cell in cells)
    end = len(places) + len(labels)
    header = json.dumps({
        "__metadata__": {"voxel_size": "0.6"},
        "cells": {"dtype": "I32", "shape": [len(cells), 3], "data_offsets": [0, len(places)]},
        "labels": {"dtype": "U8", "shape": [len(cells)], "data_offsets": [len(places), end]},
    }).encode()
    header += b" " * (-len(header) % 8)
    path.write_bytes(struct.pack("<Q", len(header)) + header + places + labels)


class SmallJob:
    def __init__(self, folder, scenes, steps=2):
        self.folder = pathlib.Path(folder)
        (self.folder / "scenes").mkdir(parents=True)
        for i in range(scenes):
            write_labels(self.folder / "scenes" / f"s{i}.sgrid", 1 + i % 10, 20 + 2 * i)
        poses = (f"{x} {x} 1.8 1.6 -0.5 0.5 -0.5 0.5\n" for x in (0.2, 0.8, 1.4))
        (self.folder / "ahead.tum").write_text("".join(poses))
        self.file = self.folder / "job.toml"
        self.file.write_text(JOB.format(model=MODEL, steps=steps))

    def run(self, *options, out="out", **variables):
        """-> the process, which has ended"""
        line = [SEMROVER, "--device", "0", "--require", "any", "--quiet", "run", str(self.file), "-o",
                str(self.folder / out), *options]
        return subprocess.run(line, env={**os.environ, **variables}, capture_output=True, text=True, timeout=300)

    def published(self, out="out"):
        """{file: hash of its bytes}; of a manifest what does not depend on when and where"""
        files = {}
        for path in sorted((self.folder / out).glob("[!.]*/**/*")):
            if path.name == "manifest.json":
                manifest = json.loads(path.read_text())
                files[str(path.relative_to(self.folder / out))] = (manifest["key"], str(manifest["files"]))
            elif path.is_file():
                files[str(path.relative_to(self.folder / out))] = hashlib.sha256(path.read_bytes()).hexdigest()
        return files

    def attempts(self, out="out"):
        return sorted(p.name for p in (self.folder / out / ".work").glob("*.*.*.*"))

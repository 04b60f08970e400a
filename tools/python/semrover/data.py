# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Drives on disk: folders that `render`, `refine` and `streets` write, and shard sets of them. Needs no device, but
Pillow for pictures."""
import io
import json
import mmap
import pathlib
import struct
import sys
import zlib
from dataclasses import dataclass

import numpy

_PICTURES = (".png", ".jpg", ".npy", ".flo", ".bin", ".pcd")


@dataclass(frozen=True)
class Frame:
    """One moment of one camera."""

    camera: str  # "" where a drive has one without a name
    number: int
    time_us: int
    ego_to_world: numpy.ndarray  # [4, 4]; vehicle axes x forward, y left, z up
    camera_to_world: numpy.ndarray  # [4, 4]; x right, y down, z forward
    pictures: dict  # kind ("color", "depth", ..): array


def _matrix(pose):
    x, y, z, w = pose["rotation"]
    made = numpy.eye(4)
    made[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    made[:3, 3] = pose["position"]
    return made


def _lines(text):
    return [json.loads(line) for line in text.splitlines()]


class _Folder:
    def __init__(self, path):
        self.path = path

    def names(self):
        return (p.relative_to(self.path).as_posix() for p in sorted(self.path.rglob("*")) if p.suffix in _PICTURES)

    def read(self, name):
        return (self.path / name).read_bytes()


class _Shards(_Folder):
    """pictures of a shard set (docs/formats.md, section 6.4), whose archives are mapped"""

    def __init__(self, path, index):
        super().__init__(path)
        self._members, self._maps = {}, {}
        for shard in index["shards"]:
            for name, offset, size, _ in shard["members"]:
                self._members[name] = shard["file"], offset, size

    def names(self):
        return iter(self._members)

    def read(self, name):
        if name not in self._members:
            return super().read(name)
        file, offset, size = self._members[name]
        if file not in self._maps:
            with open(self.path / file, "rb") as opened:
                self._maps[file] = mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ)
        return self._maps[file][offset:offset + size]

    def __getstate__(self):  # for workers that are spawned
        return {**self.__dict__, "_maps": {}}


def _store(path):
    index = path / "index.json"
    if index.is_file():
        content = json.loads(index.read_text(encoding="utf-8"))
        if isinstance(content, dict) and content.get("format") == "semrover.shards":
            return _Shards(path, content)
    return _Folder(path)


def _filtered(kind, row, above, step):
    """a row of a PNG before its filter (PNG specification, section 9.2); arrays of bytes, `step` to a pixel"""
    if kind == 0:
        return row
    if kind == 2:
        return row + above
    if kind == 1:
        return numpy.cumsum(row.reshape(-1, step), axis=0, dtype=numpy.uint8).ravel()
    now, up = row.tolist(), above.tolist()
    for i, value in enumerate(now):
        left = now[i - step] if i >= step else 0
        if kind == 3:
            now[i] = value + (left + up[i]) // 2 & 255
            continue
        corner = up[i - step] if i >= step else 0
        distances = abs(up[i] - corner), abs(left - corner), abs(left + up[i] - 2 * corner)
        now[i] = value + (left, up[i], corner)[distances.index(min(distances))] & 255
    return numpy.array(now, numpy.uint8)


def _png_rgb16(data):
    """[H, W, 3] uint16, which Pillow has no mode for; None for any other PNG"""
    width, height, depth, colors, _, _, interlaced = struct.unpack(">IIBBBBB", data[16:29])
    if (depth, colors, interlaced) != (16, 2, 0):
        return None
    packed, at = b"", 8
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        packed += data[at + 8:at + 8 + size] if kind == b"IDAT" else b""
        at += size + 12
    rows = numpy.frombuffer(zlib.decompress(packed), numpy.uint8).reshape(height, 1 + 6 * width)
    made, above = numpy.empty((height, 6 * width), numpy.uint8), numpy.zeros(6 * width, numpy.uint8)
    for y in range(height):
        above = made[y] = _filtered(rows[y, 0], rows[y, 1:], above, 6)
    return made.view(">u2").astype(numpy.uint16).reshape(height, width, 3)


def decode(data, suffix):
    """an array of a picture's bytes: [H, W] or [H, W, 3], numbers as the file has them. `suffix`: ".png", ".flo", .."""
    if suffix == ".npy":
        return numpy.load(io.BytesIO(data), allow_pickle=False)
    if suffix == ".flo":
        width, height = numpy.frombuffer(data, "<i4", 2, 4)
        return numpy.frombuffer(data, "<f4", offset=12).reshape(height, width, 2)
    rgb16 = _png_rgb16(data) if suffix == ".png" else None
    if rgb16 is not None:
        return rgb16
    from PIL import Image
    with Image.open(io.BytesIO(data)) as picture:
        return numpy.array(picture)


class Drive:
    """A drive's pictures with their cameras, poses and times.

    path: a folder, or a shard set. kinds: those to read; None: all that there are. ValueError: it has no cameras and
    times beside its pictures.
    """

    def __init__(self, path, kinds=None):
        self.path = pathlib.Path(path)
        self._store = _store(self.path)
        try:
            self.calibration = json.loads(self._store.read("calibration.json"))
            poses = _lines(self._store.read("ego_pose.jsonl").decode())
            self._times = _lines(self._store.read("timestamps.jsonl").decode())
        except FileNotFoundError as error:
            raise ValueError(f"{self.path}: expected a drive with {pathlib.Path(error.filename).name}") from None
        self._ego = {pose["time"]: _matrix(pose) for pose in poses}
        self.cameras = {s["name"]: s for s in self.calibration["rig"]["sensors"] if "lidar" not in s}
        self._mounts = {name: numpy.array(s["sensor_to_vehicle"], float) for name, s in self.cameras.items()}
        self._pictures = {}  # (camera, number): {kind: name}
        for name in self._store.names():
            self._add(name, kinds)

    def _add(self, name, kinds):
        *folders, file = name.split("/")
        if folders and folders[0] == "buffers":
            folders = folders[1:]
        if folders and folders[0] == "frames":  # of refine: frames/[CAMERA/]
            folders = [*folders[1:], "frame"]
        stem, _, _ = file.partition(".")
        camera = folders[0] if len(folders) > 1 else ""
        if not folders or not stem.isdigit() or camera not in self.cameras or (kinds and folders[-1] not in kinds):
            return
        self._pictures.setdefault((camera, int(stem)), {})[folders[-1]] = name

    def __len__(self):
        return len(self._times)

    def __getitem__(self, index):
        """Frame"""
        line = self._times[index]
        camera, number, ego = line["camera"], line["number"], self._ego[line["time"]]
        names = self._pictures.get((camera, number), {})
        pictures = {kind: decode(self._store.read(name), pathlib.PurePath(name).suffix)
                    for kind, name in names.items()}
        return Frame(camera, number, line["time"], ego, ego @ self._mounts[camera], pictures)

    def boxes(self):
        """of boxes.jsonl: {(camera, number): [object, ..]} (docs/formats.md, section 6.6); empty without it"""
        try:
            lines = _lines(self._store.read("boxes.jsonl").decode())
        except FileNotFoundError:
            return {}
        return {(line["camera"], line["number"]): line["objects"] for line in lines}


class Drives:
    """Frames of many drives, one after the other: an iterable for torch.utils.data.DataLoader (batch_size=None, or a
    collate_fn of yours), whose workers share them out.

    drives: paths. transform(frame): what is yielded in its place.
    """

    def __init__(self, drives, kinds=None, transform=None):
        self.drives = [Drive(path, kinds) for path in drives]
        self.transform = transform

    def __len__(self):
        return sum(map(len, self.drives))

    def __getitem__(self, index):
        for drive in self.drives:
            if index < len(drive):
                return self.transform(drive[index]) if self.transform else drive[index]
            index -= len(drive)
        raise IndexError(index)

    def __iter__(self):
        worker, workers = 0, 1
        if "torch.utils.data" in sys.modules:
            info = sys.modules["torch.utils.data"].get_worker_info()
            worker, workers = (info.id, info.num_workers) if info else (0, 1)
        return (self[i] for i in range(worker, len(self), workers))

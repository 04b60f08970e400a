# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Numbered pictures in folders, and in the archives of shard sets, which stand in place of folders (docs/formats.md
§6.4)."""
import io
import os
import re
from typing import NamedTuple

from PIL import Image

from .json_file import read_json

FORMAT = "semrover.shards"


class Picture(NamedTuple):
    """where one lies: bytes of a file, all if `size` is -1"""
    file: str
    first: int = 0
    size: int = -1

    def read(self):
        """-> bytes"""
        with open(self.file, "rb") as file:
            file.seek(self.first)
            return file.read(self.size)

    def open(self):
        """-> PIL's image"""
        return Image.open(io.BytesIO(self.read()))


def pictures_below(root, kinds):
    """-> {folder: {number: Picture}} of all folders below root with one of these names, with links and without hidden
    ones, that have NNNNNN.png, .jpg or .jpeg. Those of a shard set have the paths that they had in the folder. A number
    in two formats is refused."""
    found = {}

    def put(folder, name, picture):
        named = re.fullmatch(r"([0-9]+)\.(png|jpg|jpeg)", name)
        if not named or os.path.basename(folder) not in kinds:
            return
        pictures, number = found.setdefault(folder, {}), int(named[1])
        if number in pictures:
            raise SystemExit(f"{folder}: picture {number} is there twice: {named[0]} and in {pictures[number].file}")
        pictures[number] = picture

    for folder, folders, names in os.walk(os.path.normpath(root), followlinks=True):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in names:
            put(folder, name, Picture(os.path.join(folder, name)))
        if "index.json" in names:
            for path, picture in members_of(folder):
                put(*os.path.split(os.path.join(folder, path)), picture)
    return found


def members_of(folder):
    """-> [(path in the folder, Picture)] of a shard set; none of a folder whose index.json is another program's. An
    archive of another size than the index says is refused."""
    index = read_json(os.path.join(folder, "index.json"))
    if not isinstance(index, dict) or index.get("format") != FORMAT:
        return []
    out = []
    for shard in index["shards"]:
        archive = os.path.join(folder, os.path.basename(shard["file"]))
        size = os.path.getsize(archive) if os.path.exists(archive) else -1
        if size != shard["bytes"]:
            raise SystemExit(f"{archive}: expected {shard['bytes']} bytes, as index.json says, found "
                             f"{'no file' if size < 0 else size}; `semrover dataset verify {folder}` says more")
        out += [(path, Picture(archive, first, size)) for path, first, size, _ in shard["members"]]
    return out

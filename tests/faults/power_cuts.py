# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What a disk may hold after its power was cut, from a record of faulty_files.c.

What was flushed is there: a file's bytes by its own flush, names by their folder's. Of other names of a folder, those
up to some moment are there: none, all or some. Of other bytes of a file there are all, none, the first half, or zeros
in their place."""
import copy
import dataclasses
import pathlib
import random


@dataclasses.dataclass
class File:
    now: bytearray = dataclasses.field(default_factory=bytearray)
    flushed: bytes = b""


@dataclasses.dataclass
class Call:
    kind: str
    inode: str
    path: str
    other: str
    number: int
    data: bytes


def read_record(file):
    data, at, calls = pathlib.Path(file).read_bytes(), 0, []
    while at < len(data):
        end = data.index(b"\n", at)
        kind, inode, path, other, number, size = data[at:end].decode().split("\t")
        at = end + 1 + int(size)
        calls.append(Call(kind, inode, path, other, int(number), data[end + 1:at]))
    return calls


BYTES = ("all", "none", "half", "zeros")
NAMES = ("all", "none", "some")


class Disk:
    """The folder `root`, which is empty and on the disk when the record begins."""

    def __init__(self, root):
        self.root = str(root)
        self.inodes = {}  # number of a file: it
        self.folders = {self.root: 0}  # {path: flushed up to this change}
        self.changes = []  # of names, in order: (folder, names that it sets {path: File, "folder" or None})
        self.names = {}  # as a process sees them

    def apply(self, call):
        """-> whether what a cut may leave is another now"""
        path, other = call.path, call.other
        if call.kind == "create":
            self.inodes[call.inode] = File()
            self.change(path, {path: self.inodes[call.inode]})
        elif call.kind == "mkdir":
            self.change(path, {path: "folder"})
            self.folders[path] = 0
        elif call.kind == "write":
            file = self.inodes.get(call.inode)
            if file is None:
                return False
            file.now[len(file.now):] = bytes(max(0, call.number - len(file.now)))
            file.now[call.number:call.number + len(call.data)] = call.data
        elif call.kind == "cut":
            file = self.names.get(path)
            if not isinstance(file, File):
                return False
            del file.now[call.number:]
        elif call.kind == "link":
            self.change(other, {other: self.names.get(path)})
        elif call.kind == "unlink":
            self.change(path, {path: None})
        elif call.kind == "rename":
            self.rename(path, other)
        elif call.kind == "flush":
            self.flush(call)
        return True

    def flush(self, call):
        if call.path in self.folders:
            self.folders[call.path] = len(self.changes)
        elif call.inode in self.inodes:
            file = self.inodes[call.inode]
            file.flushed = bytes(file.now)

    def rename(self, path, other):
        moved = {p: what for p, what in self.names.items() if p == path or p.startswith(path + "/")}
        names = {p: None for p in moved}
        names.update({other + p[len(path):]: what for p, what in moved.items()})
        for folder in [p for p in moved if moved[p] == "folder"]:
            self.folders[other + folder[len(path):]] = self.folders.pop(folder, 0)
        self.change(other, names)

    def change(self, path, names):
        self.changes.append((path.rsplit("/", 1)[0], names))
        for name, what in names.items():
            if what is None:
                self.names.pop(name, None)
            else:
                self.names[name] = what

    def cut(self, names, data, chance):
        """-> {path: bytes, or None for a folder}"""
        until = {}
        for folder, flushed in self.folders.items():
            last = len(self.changes)
            until[folder] = last if names == "all" else flushed if names == "none" else chance.randint(flushed, last)
        there = {}
        for i, (folder, changed) in enumerate(self.changes):
            if i >= until.get(folder, len(self.changes) if names == "all" else 0):
                continue
            for path, what in changed.items():
                there.pop(path, None)
                if what is not None:
                    there[path] = what
        kept = {}
        for path in sorted(there):  # those above come first
            above = path.rsplit("/", 1)[0]
            if above == self.root or kept.get(above, b"") is None:
                kept[path] = None if there[path] == "folder" else bytes_of(there[path], data)
        return kept


def bytes_of(file, data):
    now, flushed = bytes(file.now), file.flushed
    if data == "all" or now == flushed:
        return now
    if data == "none":
        return flushed
    if data == "half":
        return now[:len(flushed) + (len(now) - len(flushed)) // 2]
    same = next((i for i, (a, b) in enumerate(zip(now, flushed)) if a != b), min(len(now), len(flushed)))
    return now[:same] + bytes(len(now) - same)


def put(kept, root):
    """into the empty folder `root`"""
    for path in sorted(kept):
        if kept[path] is None:
            pathlib.Path(path).mkdir()
        else:
            pathlib.Path(path).write_bytes(kept[path])


def cuts(calls, root, chance):
    """-> (how far, which, {path: bytes or None}) of each different disk that a cut after any call may leave"""
    disk, seen = Disk(root), set()
    for i in range(len(calls) + 1):
        if i > 0 and not disk.apply(calls[i - 1]):
            continue
        for names in NAMES:
            for data in BYTES:
                kept = disk.cut(names, data, chance)
                key = hash(frozenset(kept.items()))
                if key not in seen:
                    seen.add(key)
                    yield i, f"names {names}, bytes {data}", kept

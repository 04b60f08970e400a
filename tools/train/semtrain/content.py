# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Keys of what recipes keep: by the bytes that it was made of, not by the names of files, whose contents may change."""
import hashlib
import os

from .json_file import read_json, write_json


def digest_of_pictures(pictures, about=""):
    """as `digest`, of Pictures, which may lie in archives: the same as of files with their bytes"""
    total = hashlib.sha256(about.encode())
    for picture in pictures:
        total.update(hashlib.sha256(picture.read()).digest())
    return total.hexdigest()[:24]


def digest(paths, about=""):
    """of files, in this order, and of what else a kept thing depends on; one that is not there counts as empty"""
    total = hashlib.sha256(about.encode())
    for path in paths:
        of_file = hashlib.sha256()
        if os.path.exists(path):
            with open(path, "rb") as file:
                for part in iter(lambda: file.read(1 << 20), b""):
                    of_file.update(part)
        total.update(of_file.digest())
    return total.hexdigest()[:24]


def digest_of_folder(folder):
    """of all files below it"""
    paths = sorted(os.path.join(at, name) for at, _, names in os.walk(folder) for name in names)
    return digest(paths, " ".join(os.path.relpath(path, folder) for path in paths))


def keep_made_of(folder, about):
    """FOLDER/made_of.json says what the results that are kept there were made of, {what: value}. A value that was
    another one before is refused: the results would be of both"""
    path = os.path.join(folder, "made_of.json")
    before = read_json(path) if os.path.exists(path) else {}
    for what in sorted(before.keys() & about.keys()):
        if before[what] != about[what]:
            raise SystemExit(f"{folder} was made with {what} {before[what]}, now it is {about[what]}: remove it, or "
                             "name another folder")
    os.makedirs(folder, exist_ok=True)
    write_json(path, {**before, **about})

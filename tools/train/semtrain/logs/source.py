# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Files of a data set. What is missing or broken ends the recipe with the file's name and what was expected of it."""
import json
import os

import numpy as np
from PIL import Image


def existing(path):
    if not os.path.exists(path):
        raise SystemExit(f"{path} is missing")
    return path


def read_text(path):
    with open(existing(path), encoding="utf-8") as file:
        return file.read()


def read_json(path, kind=list):
    """an array, or with `kind` dict an object"""
    try:
        value = json.loads(read_text(path))
    except ValueError as error:
        raise SystemExit(f"{path}: broken JSON: {error}") from error
    if not isinstance(value, kind):
        raise SystemExit(f"{path}: expected JSON's {'array' if kind is list else 'object'}")
    return value


def read_numbers(path, text, count):
    """[count] f64 of words of a file"""
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise SystemExit(f"{path}: {error}") from error
    if values.size != count or not np.isfinite(values).all():
        raise SystemExit(f"{path}: expected {count} finite numbers, found {values.size}: {text.strip()[:60]!r}")
    return values


def read_floats(path, columns):
    """binary float32 [N, columns]"""
    size = os.path.getsize(existing(path))
    if size % (4 * columns):
        raise SystemExit(f"{path}: expected rows of {columns} float32, found {size} bytes")
    return np.fromfile(path, np.float32).reshape(-1, columns)


def field(path, record, name):
    """of a JSON object in a file"""
    if not isinstance(record, dict) or name not in record:
        raise SystemExit(f"{path}: {name} is missing in {str(record)[:60]}")
    return record[name]


def read_picture(path, file=None):
    """[H, W, 3] u8; `file`: its bytes, where they lie in an archive"""
    return np.array(_opened(path, file).convert("RGB"))


def read_label_picture(path, file=None):
    """[H, W] of class numbers, as they are in the file (docs/formats.md §6.1); of a palette its indices"""
    image = _opened(path, file)
    numbers = np.array(image)
    if image.format == "JPEG" or numbers.ndim != 2:
        raise SystemExit(f"{path}: expected a PNG of class numbers, grey or with a palette, found {image.format}, "
                         f"{image.mode}")
    return numbers.astype(np.int64)


def _opened(path, file):
    try:
        with Image.open(file or existing(path)) as image:
            image.load()
            return image
    except (OSError, SyntaxError) as error:
        raise SystemExit(f"{path}: not a whole picture: {error}") from error


def same_counts(what, counts):
    """counts: {name: number} that have to agree"""
    if len(set(counts.values())) > 1:
        raise SystemExit(f"{what}: counts differ: " + ", ".join(f"{n} {name}" for name, n in counts.items()))

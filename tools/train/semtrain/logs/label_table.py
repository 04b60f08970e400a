# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Tables from another program's class numbers to ours: those of assets/label_maps, and files (docs/formats.md §3)."""
import os

import numpy as np

from ..objects import CLASSES
from ..program import REPOSITORY
from .source import read_json

SKY, NOTHING = CLASSES.index("sky"), 255
FOLDER = os.path.join(REPOSITORY, "assets", "label_maps")


class LabelTable:
    """numbers -> ours; NOTHING where the table leaves out, or the number is 255"""

    def __init__(self, name):
        """of a table, or a file; `ours`: our own numbers"""
        self.name, self.classes, self.names = name, {NOTHING: NOTHING}, {}
        if name == "ours":
            self.classes.update((number, number) for number in range(len(CLASSES)))
            return
        path = name if os.path.exists(name) else os.path.join(FOLDER, name + ".json")
        if not os.path.exists(path):
            raise SystemExit(f"--map {name}: expected a file, or one of ours, "
                             + ", ".join(sorted(file[:-5] for file in os.listdir(FOLDER))))
        for number, entry in read_json(path, dict).items():
            of_table = isinstance(entry, dict)
            if not number.isdigit():
                raise SystemExit(f"{path}: expected class numbers, found {number!r}")
            self.classes[int(number)] = class_of(path, entry.get("class") if of_table else entry)
            self.names[int(number)] = entry.get("name", "") if of_table else ""

    def __call__(self, numbers, where):
        """[...] -> u8 [...]; a number that the table lacks is refused"""
        known, place = np.unique(numbers, return_inverse=True)
        unknown = [str(n) for n in known if int(n) not in self.classes]
        if unknown:
            raise SystemExit(f"{where}: the table {self.name} has no {', '.join(unknown)}; --map says whose numbers "
                             "these are")
        classes = np.array([self.classes[int(n)] for n in known], np.uint8)
        return classes[place].reshape(np.shape(numbers))

    def number_of(self, name):
        """of a class' name in the table, or None"""
        return next((number for number, own in self.names.items() if own == name), None)

    def first_numbers(self, otherwise):
        """u8 [256]: for each of our classes the first number that means it, and `otherwise`"""
        out = np.full(256, otherwise, np.uint8)
        for number, own in sorted(self.classes.items(), reverse=True):
            if own != NOTHING:
                out[own] = number
        return out


def class_of(path, entry):
    if entry is None or entry == "free":
        return NOTHING
    if entry in CLASSES:
        return CLASSES.index(entry)
    if isinstance(entry, int) and 0 <= entry < len(CLASSES):
        return entry
    raise SystemExit(f"{path}: expected a class, its number or null, found {entry!r}")

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""JSON files, written whole or not at all; a list of numbers or names is a line."""
import json
import os
import re


def read_json(path):
    with open(path) as file:
        return json.load(file)


def write_json(path, value):
    text = json.dumps(value, indent=1)
    text = re.sub(r"\[\n\s*([^][{}]*?)\n\s*\]", lambda found: "[" + re.sub(r"\n\s*", " ", found[1]) + "]", text)
    with open(path + ".part", "w") as file:
        file.write(text + "\n")
    os.replace(path + ".part", path)

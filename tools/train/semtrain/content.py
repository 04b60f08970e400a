# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Keys of what recipes keep: by the bytes that it was made of, not by the names of files, whose contents may change."""
import hashlib
import os


def digest(paths, about=""):
    """of files, in this order, and of what else a kept thing depends on; a file that is not there is one without bytes"""
    total = hashlib.sha256(about.encode())
    for path in paths:
        of_file = hashlib.sha256()
        if os.path.exists(path):
            with open(path, "rb") as file:
                for part in iter(lambda: file.read(1 << 20), b""):
                    of_file.update(part)
        total.update(of_file.digest())
    return total.hexdigest()[:24]

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a training run: one process at a time, and the same settings throughout."""
import fcntl
import json
import os

from .json_file import read_json

CHECKPOINT = "checkpoint.safetensors"
LOG = "log.jsonl"
SETTINGS = "config.json"
# nothing that has been learnt
MAY_CHANGE = ("steps", "minutes", "save_minutes", "device", "workers", "mantissa_bits", "defaults")


class RunFolder:
    """locked while it lives"""

    def __init__(self, path):
        self.path = path
        os.makedirs(path, exist_ok=True)
        self.lock = open(self.file("lock"), "a")
        try:
            fcntl.flock(self.lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SystemExit(f"another process trains in {path}; wait for it, or name another folder") from None

    def file(self, name):
        return os.path.join(self.path, name)

    def has_begun(self):
        return os.path.exists(self.file(CHECKPOINT))

    def keep_settings(self, config):
        """writes them; those of a run that goes on have to be what they were. What either does not know is not compared:
        it may come from another version of the recipes"""
        config = json.loads(json.dumps(config))
        if self.has_begun() and os.path.exists(self.file(SETTINGS)):
            before = read_json(self.file(SETTINGS))
            for name in sorted(before.keys() & config.keys() - set(MAY_CHANGE)):
                if before[name] != config[name]:
                    raise SystemExit(
                        f"{self.path} was begun with {name} = {json.dumps(before[name])}, now it is "
                        f"{json.dumps(config[name])}; go on with the former (--set), or begin another folder, with "
                        "--init where that is to start from what this one has learnt")
        with open(self.file(SETTINGS), "w") as file:
            json.dump(config, file, indent=1)

    def release(self):
        self.lock.close()

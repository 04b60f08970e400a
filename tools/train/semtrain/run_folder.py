# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a training run: one process at a time, and the same settings throughout."""
import fcntl
import json
import os
import re

from . import safetensors_file
from .json_file import read_json

CHECKPOINT = "checkpoint.safetensors"
LOG = "log.jsonl"
SETTINGS = "config.json"
# nothing that has been learnt
MAY_CHANGE = ("steps", "minutes", "save_minutes", "device", "workers", "mantissa_bits", "defaults", "accumulate",
              "recompute", "keep", "tensorboard", "encode_batch")


class RunFolder:
    """locked while it lives, unless it is not `alone`: of a process that only reads"""

    def __init__(self, path, alone=True):
        self.path, self.lock = path, None
        os.makedirs(path, exist_ok=True)
        if not alone:
            return
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
        if not self.lock:
            return
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

    def write_checkpoint(self, tensors, step, keep):
        """in place of the last one, of which the `keep` - 1 latest stay as checkpoint-STEP.safetensors"""
        latest = self.file(CHECKPOINT)
        if keep > 1 and self.has_begun():
            former = int(safetensors_file.read_header(latest)[1]["step"])
            name = self.file(f"checkpoint-{former:09d}.safetensors")
            if former != step and not os.path.exists(name):
                os.link(latest, name)  # there is a `latest` at any moment
        safetensors_file.write(latest, tensors, {"step": step})
        former = sorted(name for name in os.listdir(self.path) if re.fullmatch(r"checkpoint-\d{9}\.safetensors", name))
        for name in former[:len(former) - (keep - 1)]:
            os.remove(self.file(name))

    def release(self):
        if self.lock:
            self.lock.close()

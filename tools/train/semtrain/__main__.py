# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""python -m semtrain RECIPE ...: what tools/train/run calls. A recipe that is stopped by SIGINT or SIGTERM ends with 130,
one that has finished with 0; training saves first (trainer.py)."""
import runpy
import signal
import sys

STOPPED = 130


def stop(*_):
    raise SystemExit(STOPPED)


if __name__ == "__main__":
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    recipe = sys.argv.pop(1)
    runpy.run_module(f"semtrain.{recipe}", run_name="__main__", alter_sys=True)

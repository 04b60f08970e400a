#!/usr/bin/env python3
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Short runs of the program, for tools that watch it: ThreadSanitizer in it, or valgrind around it. Each run must end
with 0, and no tool may have anything to say.

short_runs.py COMMAND...            doctor, inspect, a generate
RENDERER=MODEL short_runs.py ...    and what has threads: a batch, render and refine with videos, a job of two tasks
"""
import os
import pathlib
import subprocess
import sys
import tempfile

SOURCES = pathlib.Path(__file__).resolve().parents[2]
MODEL = SOURCES / "tests/golden/sampling_ddpm/model"
COMMAND, RENDERER = sys.argv[1:], os.environ.get("RENDERER")
os.environ.setdefault("SEMROVER", COMMAND[-1])
sys.path.insert(0, str(SOURCES / "tests/slurm"))
from small_job import SmallJob, write_labels  # noqa: E402


def run(*words):
    print(*words, flush=True)
    done = subprocess.run([*COMMAND, *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode or "ThreadSanitizer" in done.stderr:
        sys.exit(f"{done.returncode}\n{done.stderr}")


def short_runs(folder):
    labels, grid = folder / "in.sgrid", folder / "out.sgrid"
    write_labels(labels, wall=2, length=6)
    generate = ["generate", labels, "-m", MODEL, "--steps", 1, "--region-size", 24, "--quiet"]
    run("inspect", MODEL)
    run("doctor")
    run(*generate, "-o", grid)
    if not RENDERER:
        return
    (folder / "ahead.tum").write_text("".join(f"{t} {t} 1.5 1.6 -0.5 0.5 -0.5 0.5\n" for t in (0, 1)))
    drive = [grid, "--path", folder / "ahead.tum", "-W", 56, "-H", 40, "--threads", 2, "--quiet"]
    run(*generate, "-o", folder / "batch.sgrid", "--batch", 2)
    run("render", *drive, "-o", folder / "drawn", "--video", folder / "drawn.mp4")
    run("refine", *drive, "-o", folder / "refined", "-m", RENDERER, "--steps", 1, "--video", folder / "refined.mp4")
    SmallJob(folder / "job", scenes=2, steps=1)
    run("--device", 0, "--require", "any", "run", folder / "job/job.toml", "-o", folder / "job/out")


with tempfile.TemporaryDirectory(prefix="semrover-short-") as scratch:
    short_runs(pathlib.Path(scratch))

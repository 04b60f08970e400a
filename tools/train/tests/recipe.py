# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Recipes as a user runs them: tools/train/run."""
import os
import subprocess

from semtrain import safetensors_file
from semtrain.program import REPOSITORY

RUN = os.path.join(REPOSITORY, "tools", "train", "run")


def run_recipe(recipe, output, *more):
    """-> the tensors of its checkpoint"""
    done = subprocess.run([RUN, recipe, "--config", "small", "-o", output, "--threads", "1", *more],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          env={**os.environ, "PYTHON": os.environ.get("PYTHON", "/usr/bin/python3")})
    if done.returncode:
        raise AssertionError(done.stdout)
    return safetensors_file.read(os.path.join(output, "checkpoint.safetensors"))

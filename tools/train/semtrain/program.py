# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The built `semrover`, which makes the data that the recipes train on."""
import os
import subprocess

REPOSITORY = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))


def engine_path():
    """$SEMROVER, or what tools/demo builds, whether it is there or not"""
    return os.environ.get("SEMROVER") or os.path.join(REPOSITORY, "build", "release", "semrover")


def semrover_path():
    path = engine_path()
    if not os.access(path, os.X_OK):
        raise SystemExit(f"{path} is not there: build it (cmake --preset release && cmake --build --preset release "
                         "--target programs), or name one in $SEMROVER")
    return path


def semrover(*arguments):
    """runs a subcommand; its standard output. An error ends the recipe with the program's own message."""
    done = subprocess.run([semrover_path(), *map(str, arguments)], stdout=subprocess.PIPE, text=True)
    if done.returncode:
        raise SystemExit(f"semrover {arguments[0]} ended with exit code {done.returncode}")
    return done.stdout

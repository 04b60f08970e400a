# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Makes frames to train the renderer with: streets, trajectories through them, traced pictures and splat buffers.

Calls the engine: `streets` (grids, then pictures along a short trajectory at a place that varies with the seed) and
`render`.
OUT/SEED is laid out as semtrain/frames.py says; a seed whose folder is complete is left alone.
"""
import argparse
import os
import shutil

from .content import digest, keep_made_of
from .program import semrover
from .streets import make_street

DONE = "done"
YAWS = {1: 0.3, 6: -0.3}  # of seeds by their last digit: looking to the side
BESIDE = (3, 8)           # likewise: half of the frames, and as many from 1.5 m to the left


def drive_of(seed, frames, length):
    """where a seed's trajectory runs -> {first, end margin, yaw, shift} in metres and radians; frames are 1 m apart"""
    shift = 1.5 if seed % 10 in BESIDE else 0
    count = max(1, frames // 2) if shift else frames
    first = 8 + seed * 7 % max(1, int(length) - 31)
    return {"first": first, "end-margin": length - first - count + 1, "yaw": YAWS.get(seed % 10, 0), "shift": shift}


def make_buffers(grid, drive, folder, size, splat_radius):
    """FOLDER/buffer: splats of the grid as the cameras of DRIVE see them; size: width and height"""
    buffer = os.path.join(folder, "buffer")
    shutil.rmtree(buffer, ignore_errors=True)
    semrover("render", grid, "--path", os.path.join(drive, "transforms.json"), "-W", size[0], "-H", size[1],
             "--splat-radius", splat_radius, "-o", buffer, "--quiet")


def daylight(options):
    """the sky's options of `semrover streets`, for those that are given"""
    given = {"--sun-azimuth": options.sun_azimuth, "--sun-elevation": options.sun_elevation, "--clouds": options.clouds}
    return [word for name, value in given.items() if value is not None for word in (name, value)]


def made_of(grid, options):
    """what the frames of a drive depend on beside its seed"""
    names = ("frames", "length", "samples", "shift", "sun_azimuth", "sun_elevation", "clouds", "splat_radius", "width",
             "height")
    return {"grid": digest([grid]), **{name: getattr(options, name) for name in names}}


def make_frames(grid, folder, seed, options):
    """pictures along the trajectory, and the splat buffers of the same cameras"""
    where = drive_of(seed, options.frames, options.length)
    if options.shift is not None:
        where["shift"], where["yaw"] = options.shift, 0
    size = (options.width, options.height)
    semrover("streets", "--seed", seed, "--length", options.length, "--spacing", 1, "--no-grids", "--images", "--samples",
             options.samples, "-W", size[0], "-H", size[1], *daylight(options),
             *(word for name, value in where.items() for word in (f"--{name}", value)), "-o", folder, "-y", "--quiet")
    os.remove(os.path.join(folder, "mesh.glb"))
    for drive in [folder] + ([os.path.join(folder, "shifted")] if where["shift"] else []):
        make_buffers(grid, drive, drive, size, options.splat_radius)
    with open(os.path.join(folder, DONE), "w"):
        pass


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run drives", description=__doc__.splitlines()[0])
    p.add_argument("-o", "--output", required=True, help="folder for SEED/{color,buffer,...}")
    p.add_argument("--streets", required=True, help="folder for SEED/truth.sgrid; those that are there are used")
    p.add_argument("--seeds", required=True, help="FIRST:LAST, both included")
    p.add_argument("--frames", type=int, default=8, help="of a street")
    p.add_argument("--length", type=int, default=60, help="of a street, metres")
    p.add_argument("--samples", type=int, default=2, help="rays a pixel")
    p.add_argument("--shift", type=float, help="metres to the left of a second trajectory; default: as the seed has it")
    p.add_argument("--sun-azimuth", type=float, help="degrees to the left of the street; default: as the seed has it")
    p.add_argument("--sun-elevation", type=float, help="degrees")
    p.add_argument("--clouds", type=float, help="0 to 1")
    p.add_argument("--splat-radius", default="auto", help="of the buffers, as `semrover render` takes it")
    p.add_argument("-W", "--width", type=int, default=616)
    p.add_argument("-H", "--height", type=int, default=424)
    options = p.parse_args(arguments)
    os.makedirs(options.output, exist_ok=True)
    first, _, last = options.seeds.partition(":")
    for seed in range(int(first), int(last or first) + 1):
        street, folder = (os.path.join(root, str(seed)) for root in (options.streets, options.output))
        grid, done = os.path.join(street, "truth.sgrid"), os.path.exists(os.path.join(folder, DONE))
        if not os.path.exists(grid):
            if done:
                continue  # its street is not needed any more
            make_street(street, seed, options.length)
        about = made_of(grid, options)
        if done:
            keep_made_of(folder, about)
            continue
        make_frames(grid, folder, seed, options)
        keep_made_of(folder, about)
        print(folder, flush=True)


if __name__ == "__main__":
    main()

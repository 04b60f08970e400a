# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""From a drive of PandaSet, nuScenes, KITTI-360 or InfiniCube to pairs that `transformer`, `asd` and `vsd` train on:
OUT/drive (pictures, labels, sweeps, splat buffers) and OUT/scene (mesh and grids). What is done is left as it is, and
what was made of other input refused."""
import argparse

from ..objects import CLASSES
from . import infinicube, kitti360, nuscenes, pandaset
from .pairs import Pairs

LAYOUTS = {"pandaset": pandaset, "nuscenes": nuscenes, "kitti360": kitti360, "infinicube": infinicube}


def layout_of(folder):
    found = [name for name, layout in LAYOUTS.items() if layout.is_here(folder)]
    if len(found) != 1:
        raise SystemExit(f"{folder}: found {' and '.join(found) or 'no layout'}; expected one of: lidar/poses.json and "
                         "camera/ (a sequence of PandaSet), v1.0-*/scene.json (nuScenes), calibration/perspective.txt "
                         "(KITTI-360), pose/*.tar (InfiniCube); --layout says which")
    return found[0]


def read_log(options):
    layout = LAYOUTS[options.layout or layout_of(options.drive)]
    log = layout.read(options.drive, options.scene, options.frames)
    if options.cameras:
        names = [camera.name for camera in log.cameras]
        missing = [name for name in options.cameras if name not in names]
        if missing:
            raise SystemExit(f"{options.drive}: no camera {missing[0]}; there are {', '.join(names)}")
        log = log._replace(cameras=[camera for camera in log.cameras if camera.name in options.cameras])
    if not any(camera.pictures for camera in log.cameras):
        raise SystemExit(f"{options.drive}: no pictures")
    return log


def span(text):
    first, _, last = text.partition(":")
    return int(first), int(last or first)


def names(text):
    return text.split(",")


def classes(text):
    unknown = [name for name in names(text) if name not in CLASSES]
    if unknown:
        raise argparse.ArgumentTypeError(f"no class {unknown[0]}; there are {', '.join(CLASSES)}")
    return text


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run logs", description=__doc__)
    p.add_argument("drive", metavar="DRIVE", help="a sequence of PandaSet, or the folder of one of the other data sets")
    p.add_argument("-o", "--output", required=True, help="folder for drive/ and scene/")
    p.add_argument("--layout", choices=sorted(LAYOUTS), help="default: found by what DRIVE holds")
    p.add_argument("--scene", help="which of several scenes of nuScenes, sequences of KITTI-360, clips of InfiniCube")
    p.add_argument("--labels", help="folder with CAMERA/NAME.png for each picture: class numbers of any segmentation")
    p.add_argument("--map", help="table of the class numbers (docs/formats.md §3); ours, or the data set's own")
    p.add_argument("--cameras", type=names, help="names with commas; default: all")
    p.add_argument("--frames", type=span, help="FIRST:LAST, both included: numbers of frames, of nuScenes of samples")
    p.add_argument("-W", "--width", type=int, default=616)
    p.add_argument("-H", "--height", type=int, default=424)
    p.add_argument("--exclude", type=classes, help="classes, with commas, that do not become part of the scene")
    p.add_argument("--visible", choices=["sky", "splats"],
                   help="what buffer/visible says: not sky, by the labels (default where all have some), or a splat")
    p.add_argument("--splat-radius", default="auto", help="of the buffers, as `semrover render` takes it")
    p.add_argument("--import-only", action="store_true", help="stop at OUT/drive, without the scene and buffers")
    options = p.parse_args(arguments)
    if options.labels and not options.map:
        options.map = "ours"
    pairs = Pairs(options.output, read_log(options), options)
    pairs.import_drive()
    if not options.import_only:
        pairs.fuse()
        pairs.draw_buffers()


if __name__ == "__main__":
    main()

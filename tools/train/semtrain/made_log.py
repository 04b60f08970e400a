# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Makes logs in the layout of a data set, of drives that `semrover render --rig --actors --instances --boxes` wrote
with a lidar: what `run logs` reads, with a truth to compare with (docs/logs.md)."""
import argparse
import os

from .logs import made_kitti360, made_nuscenes, made_pandaset
from .logs.rendered import Rendered
from .program import semrover

WRITERS = {"pandaset": made_pandaset.write, "kitti360": made_kitti360.write}


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run made_log", description=__doc__)
    p.add_argument("layout", choices=["pandaset", "nuscenes", "kitti360", "infinicube"])
    p.add_argument("drives", nargs="+", metavar="DRIVE", help="what `semrover render` wrote")
    p.add_argument("-o", "--output", required=True, help="folder of the data set, which is not there yet")
    options = p.parse_args(arguments)
    if os.path.exists(options.output):
        raise SystemExit(f"{options.output} is there: remove it, or name another folder")
    if options.layout in WRITERS:
        for number, folder in enumerate(options.drives):
            WRITERS[options.layout](Rendered(folder), options.output, number)
        return
    semrover("dataset", "export", *options.drives, "--to", options.layout, "-o", options.output)
    if options.layout == "nuscenes":
        made_nuscenes.add_lidarseg([Rendered(folder) for folder in options.drives], options.output)


if __name__ == "__main__":
    main()

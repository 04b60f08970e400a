# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Makes procedural streets to train on: FOLDER/SEED/truth.sgrid and semantic.sgrid, a trajectory, the mesh. A street
that is there is left as it is, and one of other settings refused."""
import argparse
import os

from .content import keep_made_of
from .program import semrover


def make_street(folder, seed, length, keep_mesh=False, placement="shifted"):
    """FOLDER/truth.sgrid holds what is seen from trajectories along the whole street. -> whether it was made now"""
    about = {"length": float(length), "placement": placement}
    if os.path.exists(os.path.join(folder, "truth.sgrid")):
        keep_made_of(folder, about)
        return False
    os.makedirs(os.path.dirname(os.path.abspath(folder)), exist_ok=True)
    semrover("streets", "--seed", seed, "--length", length, "--end-margin", 12, "--spacing", 2, "--seen", "--placement",
             placement, "-o", folder, "--quiet", "-y")
    if not keep_mesh:
        os.remove(os.path.join(folder, "mesh.glb"))
    keep_made_of(folder, about)
    return True


def main():
    p = argparse.ArgumentParser(prog="tools/train/run streets", description=__doc__)
    p.add_argument("-o", "--output", required=True, help="folder")
    p.add_argument("--first-seed", type=int, default=2000)
    p.add_argument("--count", type=int, default=110)
    p.add_argument("--length", type=float, default=60, help="metres of each street")
    p.add_argument("--keep-mesh", action="store_true", help="keep mesh.glb too: 8 MB a street")
    p.add_argument("--placement", choices=["shifted", "canonical"], default="shifted", help="of points in flat voxels")
    options = p.parse_args()
    for seed in range(options.first_seed, options.first_seed + options.count):
        folder = os.path.join(options.output, str(seed))
        if make_street(folder, seed, options.length, options.keep_mesh, options.placement):
            print(folder, flush=True)


if __name__ == "__main__":
    main()

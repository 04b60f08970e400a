#!/usr/bin/env python3
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Writes one frame of a street that nobody has seen, in SemanticKITTI's layout: 15 m of road between houses.

semantickitti.py FOLDER    FOLDER/sequences/00/voxels/000000.label, FOLDER/sequences/00/calib.txt, FOLDER/poses/00.txt
"""
import os
import struct
import sys

SIZE, EDGE, LOW = (256, 256, 32), 0.2, (0.0, -25.6, -2.0)  # voxels, metres, the box's corner in the lidar's frame
CAR, ROAD, SIDEWALK, BUILDING, VEGETATION, TRUNK, POLE, SIGN = 10, 40, 48, 50, 70, 71, 80, 81  # of semantic-kitti.yaml
GROUND = -1.6  # metres; the lidar is 1.73 m above the road
STREET = (  # label, lowest corner, highest corner, metres; what comes later lies over what came before
    (ROAD, (0.2, -3.6, GROUND - 0.2), (15.2, 3.6, GROUND)),
    (SIDEWALK, (0.2, 3.6, GROUND), (15.2, 5.6, GROUND + 0.2)),
    (SIDEWALK, (0.2, -5.6, GROUND), (15.2, -3.6, GROUND + 0.2)),
    (BUILDING, (0.2, 5.6, GROUND), (8.0, 5.8, 3.8)),
    (BUILDING, (8.0, 5.6, GROUND), (15.2, 5.8, 2.6)),
    (BUILDING, (0.2, -5.8, GROUND), (6.2, -5.6, 3.2)),
    (BUILDING, (9.2, -5.8, GROUND), (15.2, -5.6, 3.8)),
    (BUILDING, (15.2, -5.6, GROUND), (15.4, 5.6, 3.2)),
    (TRUNK, (7.6, -5.4, GROUND), (7.8, -5.2, 0.4)),
    (VEGETATION, (6.6, -6.4, 0.4), (8.8, -4.2, 2.6)),
    (CAR, (8.6, 1.4, GROUND), (12.6, 3.2, GROUND + 1.4)),
    (POLE, (6.8, 3.8, GROUND), (7.0, 4.0, 1.4)),
    (SIGN, (6.8, 3.8, 0.6), (7.0, 4.4, 1.2)),
)
CAMERA = "356 0 307.5 0 0 356 91.5 0 0 0 1 0"  # of 616 x 184 pixels; KITTI counts from the middle of the first one
LIDAR_TO_CAMERA = "0 -1 0 0 0 0 -1 -0.08 1 0 0 -0.27"


def voxels():
    labels = [0] * (SIZE[0] * SIZE[1] * SIZE[2])
    for label, low, high in STREET:
        begin, end = ([round((corner[a] - LOW[a]) / EDGE) for a in range(3)] for corner in (low, high))
        for x in range(begin[0], end[0]):
            for y in range(begin[1], end[1]):
                at = (x * SIZE[1] + y) * SIZE[2]
                labels[at + begin[2]:at + end[2]] = [label] * (end[2] - begin[2])
    return struct.pack(f"<{len(labels)}H", *labels)


def write(path, content):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "wb") as file:
        file.write(content if isinstance(content, bytes) else content.encode())


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = sys.argv[1]
    write(os.path.join(folder, "sequences/00/voxels/000000.label"), voxels())
    write(os.path.join(folder, "sequences/00/calib.txt"), f"P0: {CAMERA}\nTr: {LIDAR_TO_CAMERA}\n")
    # camera to the first camera: straight ahead, 0.4 m a frame
    write(os.path.join(folder, "poses/00.txt"), "".join(f"1 0 0 0 0 1 0 0 0 0 1 {0.4 * i:g}\n" for i in range(4)))


if __name__ == "__main__":
    main()

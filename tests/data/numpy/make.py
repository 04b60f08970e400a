# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# writes the .npz files beside it, with numpy 1.24.2: /usr/bin/python3 tests/data/numpy/make.py
import os
import zipfile

import numpy as np

here = os.path.dirname(os.path.abspath(__file__))


def path(name):
    return os.path.join(here, name)


# a grid as numpy users would write it: int64 by default, voxels unsorted, points in float32
cells = np.array([[2, 0, -1], [0, -5, 3]])
labels = np.array([19, 4])
points = (np.arange(18).reshape(2, 3, 3) - 9).astype(np.float32) / 32
colors = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)
np.savez(path("grid.npz"), cells=cells, labels=labels, points=points, colors=colors, voxel_size=0.6)

# every header: versions 2.0 and 3.0, column-major, big endian, scalar, empty
with zipfile.ZipFile(path("arrays.npz"), "w", zipfile.ZIP_DEFLATED) as z:
    def put(name, array, version):
        with z.open(name + ".npy", "w") as f:
            np.lib.format.write_array(f, array, version=version)
    m = np.arange(24, dtype=">i4").reshape(2, 3, 4)
    put("big", m, (1, 0))
    put("fortran", np.asfortranarray(m.astype("<i2")), (2, 0))
    put("both", np.asfortranarray(m.astype(">f8")), (3, 0))
    put("scalar", np.array(0.25, dtype="<f2"), (1, 0))
    put("empty", np.zeros((0, 3), dtype="u1"), (1, 0))
    put("flags", np.array([True, False]), (1, 0))
    put("text", np.array(["a", "bc"]), (1, 0))
    put("record", np.zeros(2, dtype=[("a", "i4"), ("b", "f4")]), (1, 0))

# Occ3D-nuScenes: road at z index 0..1 where x index < 9, a car above it, one "others", the rest free
semantics = np.full((200, 200, 16), 17, dtype=np.uint8)
semantics[:9, :9, :2] = 11
semantics[3:6, 3:6, 2] = 4
semantics[100, 100, 5] = 0
mask = np.zeros((200, 200, 16), dtype=np.uint8)
mask[:9, :9, :2] = 1
np.savez_compressed(path("occ3d_nuscenes.npz"), semantics=semantics, mask_lidar=mask, mask_camera=mask)

# Occ3D-Waymo, coarse, with the free label as it is in the files
voxels = np.full((200, 200, 16), 23, dtype=np.uint8)
voxels[0:3, 0:3, 0] = 13
voxels[0, 0, 1] = 6
voxels[199, 199, 15] = 15
np.savez_compressed(path("occ3d_waymo.npz"), voxel_label=voxels, infov=np.ones((200, 200, 16), dtype=np.uint8))

# a bomb: 64 MiB of zeros in 64 KiB, under the header of eight bytes
with zipfile.ZipFile(path("bomb.npz"), "w", zipfile.ZIP_DEFLATED) as z:
    with z.open("cells.npy", "w") as f:
        np.lib.format.write_array(f, np.zeros(8, dtype=np.uint8))
        f.write(bytes(64 << 20))

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A street of numpy labels, generated, drawn and refined: labels_to_frames.py MODEL OUTPUT"""
import sys

import numpy
import semrover
from PIL import Image

labels = numpy.full((40, 32, 12), 255, numpy.uint8)  # voxels of 0.6 m: 24 x 19.2 m, and 7.2 m high
labels[:, 10:22, 0] = semrover.CLASSES.index("road")
labels[:, [*range(6, 10), *range(22, 26)], 0] = semrover.CLASSES.index("sidewalk")
labels[:, [5, 26], 0:12] = semrover.CLASSES.index("building")
labels[12:19, 11:14, 1:3] = semrover.CLASSES.index("car")

with semrover.Context() as context:
    model = semrover.Model(context, sys.argv[1])
    grid = semrover.Grid.from_labels(labels, origin=(0, -16, 0))
    world = semrover.World(context, model, grid, splat_radius=model.info.splat_radius)
    for info in world.fill_grid(grid):
        print(f"\r{info.finished} of {info.wanted} tiles", end="")
    renderer = semrover.Renderer(context, model, 308, 212)
    cameras = [semrover.Camera.of_view(308, 212, 73, semrover.look((2 + 0.5 * n, -0.5, 1.7))) for n in range(3)]
    for number, frame in enumerate(renderer.frames(world, cameras)):
        Image.fromarray(frame).save(f"{sys.argv[2]}/{number:06}.png")

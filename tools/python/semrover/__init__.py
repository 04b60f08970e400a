# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Coloured 3D streets from semantic voxel grids, on any GPU with Vulkan.

    import semrover
    with semrover.Context() as context:
        model = semrover.Model(context, "assets/model")
        grid = semrover.Grid.read("street.semantic.sgrid")
        world = semrover.World(context, model, grid)
        for info in world.fill_grid(grid):
            print(info.finished, "of", info.wanted, "tiles")
        camera = semrover.Camera.of_view(616, 424, 73, semrover.look((6, -1.5, 1.7)))
        color = world.draw(camera)["color"]  # float32 [424, 616, 4]

It needs libsemrover and numpy. docs/python.md says more.
"""
from ._library import (BadInputError, DeviceLostError, Error, InternalError, InterruptedError, NoDeviceError,
                       OutOfMemoryError, PartialError, UsageError, lib as _lib)
from .camera import FORWARD, Camera, inverse, look
from .context import Context, Device, Memory, devices, on_diagnostic
from .grid import CELL, CLASSES, NO_CELL, Grid, class_color
from .model import RENDERER, VOXFIELD, Model, ModelInfo
from .renderer import Renderer, RendererInfo
from .world import CONDITIONING, FLOW_STATES, OBJECT, RETURN, Pick, World, WorldInfo, read_objects

__version__ = _lib.sr_version().decode()

__all__ = ["BadInputError", "CELL", "CLASSES", "CONDITIONING", "Camera", "Context", "Device", "DeviceLostError",
           "Error", "FLOW_STATES", "FORWARD", "Grid", "InternalError", "InterruptedError", "Memory", "Model",
           "ModelInfo", "NO_CELL", "NoDeviceError", "OBJECT", "OutOfMemoryError", "PartialError", "Pick", "RENDERER",
           "RETURN", "Renderer", "RendererInfo", "UsageError", "VOXFIELD", "World", "WorldInfo", "class_color",
           "devices", "inverse", "look", "on_diagnostic", "read_objects"]

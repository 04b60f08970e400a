# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The Python package against the program and the C headers. Variables: SEMROVER, the program; SEMROVER_LIBRARY; MODEL,
a small one of points; RENDERER, a small one of frames"""
import ctypes
import gc
import json
import os
import pathlib
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import unittest

import numpy
import semrover
from semrover import _abi

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/abi"))
import structures  # noqa: E402
SCENES = ROOT / "assets" / "scenes"
PROGRAM, MODEL, RENDERER = os.environ["SEMROVER"], os.environ["MODEL"], os.environ["RENDERER"]


def program(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], check=True, capture_output=True, text=True).stdout


class WithFolder(unittest.TestCase):
    def setUp(self):
        made = tempfile.TemporaryDirectory(prefix="semrover-python-")
        self.addCleanup(made.cleanup)
        self.folder = pathlib.Path(made.name)


class Abi(WithFolder):
    def test_structures_are_those_that_a_compiler_makes(self):
        source = self.folder / "sizes.c"
        source.write_text(structures.checks(_abi))
        subprocess.run(["cc", "-std=c11", "-I", ROOT / "engine", "-c", "-o", self.folder / "sizes.o", source],
                       check=True)

    def test_they_are_made_of_the_headers(self):
        subprocess.run([sys.executable, ROOT / "tools/python/generate.py", ROOT / "engine", "--check"], check=True)


class Grids(WithFolder):
    def test_dense_labels_come_back(self):
        labels = numpy.full((5, 4, 3), 255, numpy.uint8)
        labels[1:4, 1:3, 0] = 2
        labels[2, 2, 2] = 13
        grid = semrover.Grid.from_labels(labels, 0.5, origin=(-3, 7, 1))
        self.assertEqual((len(grid), grid.voxel_size, grid.points_per_voxel), (7, 0.5, 0))
        back, origin = grid.to_labels()
        self.assertEqual(origin, (-2, 8, 1))
        numpy.testing.assert_array_equal(back, labels[1:4, 1:3])
        grid.write(self.folder / "straße ü.sgrid")
        again = semrover.Grid.read(self.folder / "straße ü.sgrid")
        numpy.testing.assert_array_equal(again.cells, grid.cells)
        grid.set_cells([[-1, 9, 3, semrover.NO_CELL]])
        self.assertEqual(len(grid), 6)

    def test_points_are_those_of_the_file(self):
        grid = semrover.Grid.read(SCENES / "street.truth.sgrid")
        points, cells = grid.points, grid.cells
        self.assertEqual(points.shape, (len(grid), 20, 6))
        at = numpy.stack([cells["i"], cells["j"], cells["k"]], 1)[:, None] * grid.voxel_size
        self.assertTrue(((points[..., :3] >= at - 0.01) & (points[..., :3] <= at + grid.voxel_size + 0.01)).all())
        self.assertTrue(((points[..., 3:] >= 0) & (points[..., 3:] <= 1)).all())


class Drawing(WithFolder):
    @classmethod
    def setUpClass(cls):
        cls.context = semrover.Context()
        cls.addClassCleanup(cls.context.close)
        cls.grid = semrover.Grid.read(SCENES / "street.truth.sgrid")
        cls.world = semrover.World(cls.context, grid=cls.grid, splat_radius=0.04)
        for _ in cls.world.fill_grid(cls.grid):
            pass

    def test_pictures_are_those_of_render(self):
        from PIL import Image
        program("render", SCENES / "street.truth.sgrid", "--path", SCENES / "street.tum", "-W", 154, "-H", 106,
                "--splat-radius", 0.04, "--npy", "-o", self.folder / "drive", "-q")
        drawn = json.loads((self.folder / "drive/transforms.json").read_text())
        to_opencv = numpy.diag([1.0, -1, -1, 1])  # of OpenGL's axes
        for number in (0, 3):
            pose = numpy.array(drawn["frames"][number]["transform_matrix"]) @ to_opencv
            camera = semrover.Camera(154, 106, drawn["fl_x"], drawn["fl_y"], drawn["cx"], drawn["cy"], pose)
            seen = self.world.draw(camera, color="uint8", depth=True, label="uint8")
            color = numpy.array(Image.open(self.folder / f"drive/color/{number:06}.png"))
            label = numpy.array(Image.open(self.folder / f"drive/label/{number:06}.png"))
            median = numpy.load(self.folder / f"drive/depth_median/{number:06}.npy")
            numpy.testing.assert_array_equal(seen["color"][..., :3], color)
            numpy.testing.assert_array_equal(seen["depth"][..., 1], median)
            visible = label != semrover.CLASSES.index("sky")  # which is where nothing is
            numpy.testing.assert_array_equal(seen["label"][visible], label[visible])

    def test_into_arrays_that_are_there_and_as_tensors(self):
        camera = semrover.Camera.of_view(64, 48, 73, semrover.look((6, -1.5, 1.7)))
        out = {"color": numpy.zeros((48, 64, 4), numpy.float32)}
        seen = self.world.draw(camera, out=out)
        self.assertIs(seen["color"], out["color"])
        self.assertGreater(out["color"][..., 3].mean(), 0.3)
        with self.assertRaisesRegex(ValueError, r"out\['color'\]: expected a contiguous array float32 \[48, 64, 4\]"):
            self.world.draw(camera, out={"color": out["color"][::2]})
        try:
            import torch
        except ImportError:
            return
        tensor = torch.from_dlpack(out["color"])
        out["color"][0, 0, 0] = 7
        self.assertEqual(tensor[0, 0, 0].item(), 7)  # no copy

    def test_lens_shutter_flow_and_lidar(self):
        camera = semrover.Camera.of_view(64, 48, 73, semrover.look((6, -1.5, 1.7)))
        still = self.world.draw(camera)["color"]
        pose = camera.camera_to_world
        moving = semrover.Camera(64, 48, camera.fx, camera.fy, camera.cx, camera.cy, pose, shutter="down",
                                 readout=(-0.01, 0.01), readout_to_world=(pose, pose))
        numpy.testing.assert_array_equal(self.world.draw(moving)["color"], still)
        wide = semrover.Camera(64, 48, 20, 20, 32, 24, pose, model="fisheye", distortion=(-0.03, 0.01))
        self.assertGreater((self.world.draw(wide)["color"][..., 3] > 0.5).mean(), 0.2)
        flow, states = self.world.flow(camera, camera.at(semrover.look((6.2, -1.5, 1.7)), 0.1))
        self.assertEqual(set(numpy.unique(states)) - {0, 1, 2, 3}, set())
        below = (states == 1)[40:, 20:44]
        self.assertTrue((flow[40:, 20:44][below][:, 1] > 0).all() and below.any())  # the road comes nearer
        sensor = numpy.eye(4)
        sensor[:3, 3] = (6, -1.5, 1.9)
        returns = self.world.sweep("xt32", sensor)
        road = returns[returns["label"] == 0]
        self.assertGreater(len(road), 1000)
        self.assertLess(abs(numpy.median(road["z"]) + 1.9), 0.05)
        found = self.world.pick(camera, 32, 40)
        self.assertEqual(semrover.CLASSES[found.label], "road")

    def test_misuse_raises(self):
        camera = semrover.Camera.of_view(64, 48, 73)
        for kind, line, call in (
                (semrover.BadInputError, "/nonexistent", lambda: semrover.Grid.read("/nonexistent")),
                (semrover.UsageError, "radius of 0 to 2000 m", lambda: self.world.focus((0, 0, 0), radius=1e9)),
                (semrover.UsageError, "focus", lambda: self.world.focus((numpy.nan, 0, 0))),
                (semrover.NoDeviceError, "nonesuch", lambda: semrover.Context("nonesuch")),
                (semrover.BadInputError, "/nonexistent", lambda: semrover.Model(self.context, "/nonexistent")),
                (semrover.UsageError, "", lambda: self.world.draw(semrover.Camera(0, 48, 1, 1, 1, 1))),
                (semrover.BadInputError, "", lambda: self.world.draw(semrover.Camera(64, 48, 0, 1, 1, 1))),
                (semrover.BadInputError, "lidar", lambda: self.world.sweep("none", numpy.eye(4))),
                (ValueError, "cells", lambda: semrover.Grid(0.6, [[1, 2, 3]])),
                (ValueError, "model", lambda: self.world.draw(semrover.Camera(4, 4, 1, 1, 1, 1, model="cube"))),
                (TypeError, "sead", lambda: semrover.World(self.context, grid=self.grid, sead=3)),
                (ctypes.ArgumentError, "", lambda: semrover.Grid("0.6"))):
            with self.subTest(line=line), self.assertRaisesRegex(kind, line):
                call()
        self.assertEqual(self.world.draw(camera)["color"].shape, (48, 64, 4))

    def test_what_is_closed_says_so(self):
        with semrover.Context() as context:
            world = semrover.World(context, grid=self.grid)
        self.assertTrue(world.closed)
        with self.assertRaisesRegex(semrover.UsageError, "World is closed"):
            world.step()
        context.close()


class Generating(WithFolder):
    def test_a_world_is_what_generate_makes(self):
        grid = self.labels()
        grid.write(self.folder / "labels.sgrid")
        program("generate", self.folder / "labels.sgrid", "-m", MODEL, "--order", "tiles", "--tile-size", 4.8,
                "--steps", 2, "--seed", 5, "-o", self.folder / "made.sgrid", "-q")
        expected = semrover.Grid.read(self.folder / "made.sgrid")
        seen = []
        with semrover.Context() as context:
            model = semrover.Model(context, MODEL, progress=lambda done, total: seen.append((done, total)))
            world = semrover.World(context, model, grid, steps=2, seed=5, tile_size=4.8, splat_bytes=0)
            finished = [info.finished for info in world.fill_grid(grid, seconds=0.01)]
            made = world.copy_cells()
        self.assertEqual(finished[-1], max(finished))
        self.assertEqual(seen[-1][0], seen[-1][1])
        numpy.testing.assert_array_equal(made.cells, expected.cells)
        numpy.testing.assert_array_equal(made.points, expected.points)

    def test_labels_of_a_callback_and_its_exceptions(self):
        cells = self.labels().cells
        asked = []

        def labels(low, high):
            asked.append(low)
            if len(asked) == 2:
                raise KeyError("no labels here")
            return cells[(cells["i"] >= low[0]) & (cells["i"] <= high[0]) & (cells["j"] >= low[1]) &
                         (cells["j"] <= high[1])]
        with semrover.Context() as context:
            world = semrover.World(context, semrover.Model(context, MODEL), labels=labels, steps=1, tile_size=4.8)
            world.focus((4, 0, 1), radius=6)
            with self.assertRaisesRegex(KeyError, "no labels here"):
                for _ in world.fill():
                    pass
            for info in world.fill():  # goes on
                pass
            self.assertEqual(info.finished, info.wanted)

    def test_ctrl_c_stops_and_the_world_goes_on(self):
        grid = self.labels()
        with semrover.Context() as context:
            world = semrover.World(context, semrover.Model(context, MODEL), grid, steps=50, tile_size=4.8)
            timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
            timer.start()
            with self.assertRaises(KeyboardInterrupt):
                while True:
                    world.edit([[3, 0, 0, 1], [4, 0, 0, 0]])  # always something to do
                    world.focus((4, 0, 1), radius=20)
                    for _ in world.fill(0.02):
                        pass
                    world.edit([[3, 0, 0, 0], [4, 0, 0, 1]])
            self.assertGreater(world.info.wanted, 0)

    def test_a_model_whose_loading_is_given_up(self):
        with semrover.Context() as context:
            with self.assertRaises(semrover.InterruptedError):
                semrover.Model(context, MODEL, progress=lambda done, total: 1)

    @staticmethod
    def labels():
        labels = numpy.full((16, 16, 3), 255, numpy.uint8)
        labels[:, :, 0] = 0
        labels[:, 0] = 2
        return semrover.Grid.from_labels(labels, origin=(0, -8, 0))


class Frames(WithFolder):
    def test_frames_are_those_of_refine(self):
        from PIL import Image
        program("refine", SCENES / "street.truth.sgrid", "-m", RENDERER, "--path", SCENES / "street.tum", "-W", 64,
                "-H", 48, "--steps", 2, "--frames", "0:2", "-o", self.folder / "drive", "-q")
        drawn = json.loads((self.folder / "drive/transforms.json").read_text())
        with semrover.Context() as context:
            renderer = semrover.Renderer(context, semrover.Model(context, RENDERER, semrover.RENDERER), 64, 48, steps=2)
            for number, frame in enumerate(drawn["frames"]):
                pose = numpy.array(frame["transform_matrix"]) @ numpy.diag([1.0, -1, -1, 1])
                camera = semrover.Camera(64, 48, drawn["fl_x"], drawn["fl_y"], drawn["cx"], drawn["cy"], pose)
                buffers = self.folder / "drive/buffers"
                seen = numpy.dstack([numpy.array(Image.open(buffers / f"{kind}/{number:06}.png"))
                                     for kind in ("color", "visible")])
                depth = numpy.array(Image.open(buffers / f"depth/{number:06}.png")).astype(numpy.uint16)
                made = renderer.frame_of(numpy.ascontiguousarray(seen), depth, camera)
                expected = numpy.array(Image.open(self.folder / f"drive/frames/{number:06}.png"))
                numpy.testing.assert_array_equal(made, expected)
            self.assertEqual(renderer.info.frames, len(drawn["frames"]))


class Leaks(unittest.TestCase):
    def test_two_hundred_contexts(self):
        grid = semrover.Grid.from_labels(numpy.zeros((4, 4, 1), numpy.uint8))

        def once():
            with semrover.Context() as context:
                semrover.World(context, grid=grid)
            semrover.World(semrover.Context(), grid=grid)  # left to the collector
        for _ in range(20):
            once()
        gc.collect()
        files, memory = len(os.listdir("/proc/self/fd")), self.resident()
        for _ in range(90):
            once()
        gc.collect()
        self.assertLessEqual(len(os.listdir("/proc/self/fd")), files)
        self.assertLess(self.resident() - memory, 40e6)

    @staticmethod
    def resident():
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * resource.getpagesize()


if __name__ == "__main__":
    unittest.main(verbosity=2)

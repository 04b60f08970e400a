# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A drive through a made street, with two cars that pass, in the layout of each data set, and imported again: how far
poses, lenses, points, labels and pictures are from the truth. `python3 test_logs.py --print` prints that."""
import contextlib
import functools
import io
import os
import shutil
import sys
import tempfile
import unittest

import numpy as np
from PIL import Image
from scipy.ndimage import binary_dilation, binary_erosion
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from semtrain import made_log
from semtrain.frames import find_drives
from semtrain.grids import find_grids, read_grid
from semtrain.json_file import read_json, write_json
from semtrain.logs.__main__ import main as run_logs
from semtrain.logs.boxes import Track, moving_boxes, used_picture
from semtrain.logs.import_drive import OPENGL
from semtrain.logs.kitti360 import read_times
from semtrain.logs.label_table import NOTHING, SKY, LabelTable
from semtrain.logs.lens import Mei, OpenCv, Undistortion, rays_of
from semtrain.logs.made_kitti360 import fisheye_of, write_fisheye
from semtrain.logs.motion import Motion, rigid, transformed
from semtrain.logs.rendered import Rendered
from semtrain.program import semrover

LAYOUTS = ("pandaset", "nuscenes", "kitti360", "infinicube")
CAMERAS = {"pandaset": "{}_camera", "nuscenes": "CAM_{}", "kitti360": "image_0{}", "infinicube": "{}"}
SIZE = (96, 64)
MOMENTS, EVERY = 11, 0.05
MOVING = {252: (2.0, 25, -6), 256: (-4.5, 12, 10)}  # parked cars that drive here: y, x at time 0, speed along x
RIG = {"sensors": [
    {"name": "front", "model": "pinhole", "width": 96, "height": 64, "fov": 80,
     "sensor_to_vehicle": {"translation": [0.1, 0, -0.05], "rotation": [-0.5, 0.5, -0.5, 0.5]}},
    {"name": "left", "model": "pinhole", "width": 96, "height": 72, "fov": 90,
     "sensor_to_vehicle": {"translation": [0, 0.2, 0], "rotation": [-0.5 ** 0.5, 0, 0, 0.5 ** 0.5]}},
    {"name": "lidar_top", "lidar": {"columns": 360, "rate": 10, "start": 180, "range": [0.5, 60],
                                    "elevations": [4, 2, 0, -2, -4, -6, -8, -10, -13, -16, -20, -25]},
     "sensor_to_vehicle": {"translation": [-0.5, 0.1, 0.4], "rotation": [0, 0, 0.0871557, 0.9961947]}}]}


def write_path(path):
    """8 m/s and 8 degrees a second to the left"""
    rows = []
    for i in range(MOMENTS):
        t = i * EVERY
        turned = Rotation.from_euler("z", 8 * t, degrees=True).as_matrix() @ [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
        rows.append([t, 8 + 8 * t, -1.65 + 0.4 * t, 1.7, *Rotation.from_matrix(turned).as_quat()])
    np.savetxt(path, rows, fmt="%.9f")


def write_actors(path, objects):
    actors = []
    for thing in read_json(objects)["objects"]:
        if thing["id"] in MOVING:
            y, x, speed = MOVING[thing["id"]]
            q = Rotation.from_euler("z", thing["heading"]).as_quat().tolist()
            poses = [{"time": t * 1000000, "position": [x + speed * t, y, thing["center"][2]], "rotation": q}
                     for t in (-1, 0, 1)]
            actors.append({"id": thing["id"], "class": "car", "size": thing["size"], "from": "object", "poses": poses})
    write_json(path, {"format": "semrover.actors", "version": 1, "actors": actors})


def quietly(call, *arguments):
    with contextlib.redirect_stdout(io.StringIO()):
        return call(*arguments)


def psnr(a, b):
    error = np.square(a.astype(float) - b).mean()
    return 10 * np.log10(255 ** 2 / max(error, 1e-10))


class Logs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.holder = tempfile.TemporaryDirectory()
        street, drive = cls.path("street"), cls.path("clip")
        semrover("streets", "--seed", 3, "--length", 40, "--points", 12, "--spacing", 1, "--first", 8, "--end-margin",
                 31, "-o", street, "--quiet")
        write_path(cls.path("path.tum"))
        write_json(cls.path("rig.json"), RIG)
        objects = os.path.join(street, "objects.json")
        write_actors(cls.path("actors.json"), objects)
        semrover("render", os.path.join(street, "truth.sgrid"), "--path", cls.path("path.tum"), "--rig",
                 cls.path("rig.json"), "--actors", cls.path("actors.json"), "--objects", objects, "--instances",
                 "--boxes", "--splat-radius", "auto", "-o", drive, "--quiet")
        cls.truth = Rendered(drive)

    @classmethod
    def tearDownClass(cls):
        cls.holder.cleanup()

    @classmethod
    def path(cls, *parts):
        return os.path.join(cls.holder.name, *parts)

    @classmethod
    @functools.lru_cache(None)
    def log(cls, layout):
        """-> the folder for `run logs`"""
        quietly(made_log.main, [layout, cls.path("clip"), "-o", cls.path(layout)])
        return cls.path(layout, "001") if layout == "pandaset" else cls.path(layout)

    @classmethod
    def run_logs(cls, folder, output, *more):
        quietly(run_logs, [folder, "-o", output, "-W", str(SIZE[0]), "-H", str(SIZE[1]), "--import-only", *more])
        return os.path.join(output, "drive")

    @classmethod
    @functools.lru_cache(None)
    def imported(cls, layout):
        return cls.run_logs(cls.log(layout), cls.path("of_" + layout))

    @classmethod
    def pairs(cls, layout):
        """-> [(entry of transforms.json, sensor, truth Frame)], in the order of time"""
        every = 2 if layout == "kitti360" else 1
        entries = read_json(os.path.join(cls.imported(layout), "transforms.json"))["frames"]
        for number, (name, (sensor, frames)) in enumerate(cls.truth.cameras.items()):
            key = {"kitti360": number, "nuscenes": name.upper()}.get(layout, name)
            own = [e for e in entries if e["camera"] == CAMERAS[layout].format(key)]
            frames = frames[::every]
            frames = frames[:-1] if layout == "kitti360" else frames
            assert len(own) == len(frames), (layout, name, len(own), len(frames))
            yield from ((e, sensor, f) for e, f in zip(own, frames))

    @classmethod
    def sweeps(cls, layout):
        """-> [(sweep's entry, its points, truth Scan)]"""
        folder = os.path.join(cls.imported(layout), "lidar")
        scans = cls.truth.scans[1::2] if layout == "kitti360" else cls.truth.scans
        sweeps = read_json(os.path.join(folder, "sweeps.json"))["sweeps"]
        assert len(sweeps) == len(scans)
        return [(s, np.load(os.path.join(folder, "points", f"{i:06d}.npy")), scan)
                for i, (s, scan) in enumerate(zip(sweeps, scans))]

    @classmethod
    def moved(cls, layout):
        """metres by which the log's world lies beside the drive's"""
        if layout != "nuscenes":
            return np.zeros(3)
        entry, _, frame = next(cls.pairs(layout))
        return np.array(entry["transform_matrix"])[:3, 3] - frame.pose[:3, 3]

    @classmethod
    @functools.lru_cache(None)
    def errors(cls, layout):
        """of poses in metres and degrees, of lenses in pixels, of pictures in dB: the largest, and the least PSNR"""
        out = {"metres": 0, "degrees": 0, "pixels": 0, "psnr": np.inf}
        for entry, sensor, frame in cls.pairs(layout):
            pose = np.array(entry["transform_matrix"]) @ OPENGL
            turn = Rotation.from_matrix(pose[:3, :3].T @ frame.pose[:3, :3]).magnitude()
            cut = (sensor["height"] - SIZE[1]) / 2
            lens = [sensor["fx"], sensor["fy"], sensor["cx"], sensor["cy"] - cut]
            picture, truth = (np.array(Image.open(path).convert("RGB")) for path in (
                os.path.join(cls.imported(layout), entry["file_path"]), frame.color))
            found = {"metres": np.linalg.norm(pose[:3, 3] - frame.pose[:3, 3] - cls.moved(layout)),
                     "degrees": np.degrees(turn),
                     "pixels": max(abs(entry[k] - v) for k, v in zip(("fl_x", "fl_y", "cx", "cy"), lens))}
            out = {**out, **{k: max(out[k], v) for k, v in found.items()},
                   "psnr": min(out["psnr"], psnr(picture, truth[int(cut):int(cut) + SIZE[1]]))}
        return out

    @classmethod
    @functools.lru_cache(None)
    def point_errors(cls, layout):
        """metres: median and largest; poses of sweeps; labels right; points of moving cars that stay, others that go"""
        distances, labels, poses, left_in, moving, lost, standing = [], [], [], 0, 0, 0, 0
        entry, _, frame = next(cls.pairs(layout))
        start = frame.time - entry["time"]
        way = Motion([scan.time for scan in cls.truth.scans], [scan.end for scan in cls.truth.scans])
        for sweep, points, scan in cls.sweeps(layout):
            truth = scan.points()
            tree = cKDTree(transformed(scan.end, truth[:, :3].astype(float)) + cls.moved(layout))
            distance, nearest = tree.query(transformed(np.array(sweep["end"]), points[:, :3].astype(float)))
            moves = np.isin(truth[:, 7], [thing + 1 for thing in MOVING])
            distances.append(distance)
            labels.append((points[:, 6], truth[nearest, 6]))
            begin, end = way.at(start + (sweep["time"] - np.array([sweep["duration"], 0])) * 1e-6)
            poses += [np.linalg.norm(np.array(sweep[k])[:3, 3] - pose[:3, 3] - cls.moved(layout))
                      for k, pose in (("begin", begin), ("end", end))]
            left_in, moving = left_in + moves[nearest].sum(), moving + moves.sum()
            lost += (~moves).sum() - (~moves[nearest]).sum()
            standing += (~moves).sum()
        distances = np.concatenate(distances)
        return {"median": np.median(distances), "largest": distances.max(), "poses": max(poses),
                "left in": int(left_in), "moving": int(moving), "lost": lost / standing,
                "labels": [np.concatenate(part) for part in zip(*labels)]}

    def test_poses_lenses_and_pictures_are_those_of_the_drive(self):
        for layout in LAYOUTS:
            with self.subTest(layout):
                errors = self.errors(layout)
                self.assertLess(errors["metres"], 1e-6)
                self.assertLess(errors["degrees"], 1e-5)
                self.assertLess(errors["pixels"], 1e-6)
                self.assertGreater(errors["psnr"], 90 if layout == "kitti360" else 30)  # the others have JPEGs

    def test_the_program_reads_the_same_poses(self):
        """PandaSet's poses.json and KITTI-360's cam0_to_world.txt, which it knows by itself"""
        poses = "data_poses/2013_05_28_drive_0000_sync/cam0_to_world.txt"
        for layout, path, camera in (("pandaset", "camera/front_camera/poses.json", "front_camera"),
                                     ("kitti360", poses, "image_00")):
            out = self.path(layout + ".tum")
            semrover("convert", os.path.join(self.log(layout), path), out, "--quiet")
            rows = np.loadtxt(out)
            own = [e for e in read_json(os.path.join(self.imported(layout), "transforms.json"))["frames"]
                   if e["camera"] == camera]
            self.assertEqual(len(rows), len(own))
            for row, entry in zip(rows, own):
                pose = np.array(entry["transform_matrix"]) @ OPENGL
                np.testing.assert_allclose(row[1:4], pose[:3, 3], atol=1e-6)
                turned = Rotation.from_quat(row[4:]).as_matrix()
                np.testing.assert_allclose(turned, pose[:3, :3], atol=1e-6)

    def test_pictures_of_a_log_at_its_own_size_keep_their_pixels(self):
        picture = np.array(Image.open(os.path.join(self.log("pandaset"), "camera", "front_camera", "03.jpg")))
        own = np.array(Image.open(os.path.join(self.imported("pandaset"), "front_camera", "color", "000003.png")))
        self.assertEqual(int(np.abs(picture.astype(int) - own).max()), 0)

    def test_points_lie_where_they_were_measured(self):
        for layout, most in (("pandaset", 2e-4), ("nuscenes", 2e-4), ("kitti360", 2e-2)):
            with self.subTest(layout):
                errors = self.point_errors(layout)
                self.assertLess(errors["median"], most / 2)
                self.assertLess(errors["largest"], most)
                self.assertLess(errors["poses"], most)

    def test_cars_that_move_are_left_out_and_those_that_stand_stay(self):
        for layout in ("pandaset", "nuscenes", "kitti360"):
            with self.subTest(layout):
                errors = self.point_errors(layout)
                self.assertGreater(errors["moving"], 100)
                self.assertLess(errors["left in"], 0.02 * errors["moving"])  # splats of a car may stand out of its box
                self.assertLess(errors["lost"], 0.03)
                parked = [i + 1 for i, (name, _, _) in self.truth.things.items() if name == "car" and i not in MOVING]
                before = after = 0
                for sweep, points, scan in self.sweeps(layout):
                    truth = scan.points()
                    cars = transformed(scan.end, truth[np.isin(truth[:, 7], parked), :3].astype(float))
                    kept = transformed(np.array(sweep["end"]), points[:, :3].astype(float)) - self.moved(layout)
                    before, after = before + len(cars), after + (cKDTree(kept).query(cars)[0] < 1e-3).sum()
                self.assertGreater(before, 100)
                self.assertGreater(after, 0.97 * before)

    def test_points_have_the_labels_of_the_layout(self):
        for layout in ("pandaset", "nuscenes"):
            found, truth = self.point_errors(layout)["labels"]
            table = LabelTable(layout)
            back = np.array([table.classes.get(n, NOTHING) for n in table.first_numbers(0)])[truth.astype(int)]
            has = found != NOTHING
            with self.subTest(layout):
                self.assertGreater(has.mean(), 0.9 if layout == "pandaset" else 0.1)  # nuScenes labels key frames
                self.assertEqual(int((found[has] != back[has]).sum()), 0)
        self.assertEqual(set(self.point_errors("kitti360")["labels"][0]), {NOTHING})

    def test_pixels_that_show_what_moves_are_not_used(self):
        for layout in LAYOUTS:
            hidden = shown = 0
            for entry, sensor, frame in self.pairs(layout):
                used = entry["file_path"].replace("color", "used")
                used = np.array(Image.open(os.path.join(self.imported(layout), used)))
                cut = (sensor["height"] - SIZE[1]) // 2
                instances = np.array(Image.open(frame.color.replace("color", "instance")))[cut:cut + SIZE[1]]
                moves = np.isin(instances, [thing + 1 for thing in MOVING])
                self.assertEqual(set(np.unique(used)) - {0, 255}, set())
                near = binary_dilation(used == 0, np.ones((3, 3)))  # splats fade out over a pixel
                self.assertEqual(int((moves & ~near).sum()), 0, entry["file_path"])
                self.assertLess(int((moves & (used != 0)).sum()), 0.02 * moves.sum() + 6, entry["file_path"])
                hidden, shown = hidden + (used == 0).sum(), shown + moves.sum()
            with self.subTest(layout):
                self.assertGreater(shown, 100)
                self.assertLess(hidden, 4 * shown)

    def test_label_pictures_are_those_of_the_layout(self):
        for layout in ("kitti360", "infinicube"):
            table = LabelTable(self_table := {"kitti360": "kitti360", "infinicube": "waymo"}[layout])
            numbers = table.first_numbers(0)
            back = np.array([table.classes.get(n, NOTHING) for n in numbers])
            for entry, sensor, frame in self.pairs(layout):
                cut = (sensor["height"] - SIZE[1]) // 2
                labels = np.array(Image.open(os.path.join(self.imported(layout), entry["label_file_path"])))
                truth = np.array(Image.open(frame.label))[cut:cut + SIZE[1]]
                known = (back[truth] != NOTHING) | (truth == 10)
                expected = np.where(truth == 10, 10, back[truth])
                with self.subTest(layout, table=self_table, picture=entry["label_file_path"]):
                    self.assertGreater(known.mean(), 0.9)
                    self.assertLess(float((labels != expected)[known].mean()), 1e-9 if layout == "kitti360" else 0.2)

    def test_depth_of_infinicube_is_kept_but_for_what_moves(self):
        folder, kept = self.imported("infinicube"), 0
        self.assertEqual(read_json(os.path.join(folder, "transforms.json"))["depth_unit_scale_factor"], 0.01)
        for entry, sensor, frame in self.pairs("infinicube"):
            cut = (sensor["height"] - SIZE[1]) // 2
            depth = np.array(Image.open(os.path.join(folder, entry["depth_file_path"]))) * 0.01
            truth, instances = (np.array(Image.open(frame.color.replace("color", kind)))[cut:cut + SIZE[1]]
                                for kind in ("depth", "instance"))
            moves, has = np.isin(instances, [thing + 1 for thing in MOVING]), depth > 0
            self.assertLess(float(np.abs(depth - truth * 1e-3)[has].max()), 0.0101)
            inside = binary_erosion(moves, np.ones((3, 3)))  # at its edges depth is a mean of it and what is behind
            self.assertLess(int((inside & has).sum()), 0.05 * moves.sum() + 1)
            kept += (has & (truth > 0)).sum() / (truth > 0).sum() / 2 / MOMENTS
        self.assertGreater(kept, 0.9)

    def test_a_fisheye_becomes_a_pinhole_of_90_degrees(self):
        """a smooth panorama, through KITTI-360's fisheye and imported, is what a pinhole sees of it"""
        def color_of(ray):
            x, y, z = np.moveaxis(ray / np.linalg.norm(ray, axis=-1, keepdims=True), -1, 0)
            return np.stack([127 + 100 * np.sin(3 * x), 127 + 100 * np.sin(3 * y), 127 + 100 * z], -1)

        width, height = 720, 360
        u, v = np.meshgrid(((np.arange(width) + 0.5) / width * 2 - 1) * np.pi,
                           (np.arange(height) + 0.5) / height * np.pi)
        around = np.stack([np.sin(v) * np.sin(u), -np.cos(v), np.sin(v) * np.cos(u)], -1)
        fisheye = fisheye_of(color_of(around).round().astype(np.uint8), {"width": width, "height": height})
        folder = self.path("fisheye")
        shutil.copytree(self.log("kitti360"), folder)
        write_fisheye(os.path.join(folder, "calibration", "image_02.yaml"))
        raw = os.path.join(folder, "data_2d_raw", "2013_05_28_drive_0000_sync")
        os.makedirs(os.path.join(raw, "image_02", "data_rgb"))
        shutil.copy(os.path.join(raw, "image_00", "timestamps.txt"), os.path.join(raw, "image_02"))
        Image.fromarray(fisheye).save(os.path.join(raw, "image_02", "data_rgb", "0000000004.png"))
        drive = self.run_logs(folder, self.path("round"), "--cameras", "image_00,image_02", "--frames", "4:4")
        frame = read_json(os.path.join(drive, "transforms.json"))["frames"][1]
        picture = np.array(Image.open(os.path.join(drive, frame["file_path"])))
        self.assertEqual(frame["file_path"], "image_02/color/000000.png")
        self.assertAlmostEqual(2 * np.degrees(np.arctan(SIZE[0] / 2 / frame["fl_x"])), 90)
        x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
        a, b = (x - frame["cx"]) / frame["fl_x"], (y - frame["cy"]) / frame["fl_y"]
        self.assertGreater(psnr(picture, color_of(np.stack([a, b, np.ones_like(a)], -1))), 45)

    def test_an_empty_line_of_times_lies_between_its_neighbours(self):
        path = self.path("timestamps.txt")
        with open(path, "w") as file:
            file.write("2013-05-28 08:46:02.900000000\n\n2013-05-28 08:46:03.100000512\n")
        first, second, third = read_times(path)
        self.assertAlmostEqual(second - first, 0.1, places=6)
        self.assertAlmostEqual(third - first, 0.200000512, places=6)

    def test_a_distortion_that_somebody_adds_to_pandaset_is_taken_out(self):
        folder = self.path("distorted")
        shutil.copytree(self.log("pandaset"), folder)
        path = os.path.join(folder, "camera", "front_camera", "intrinsics.json")
        write_json(path, {**read_json(path), "distortion": [-0.2, 0.02, 0, 0, 0]})
        drive = self.run_logs(folder, self.path("straight"), "--cameras", "front_camera", "--frames", "0:0")
        frame = read_json(os.path.join(drive, "transforms.json"))["frames"][0]
        picture = np.array(Image.open(os.path.join(drive, frame["file_path"])))
        source = np.array(Image.open(os.path.join(folder, "camera", "front_camera", "00.jpg")))
        lens = self.truth.cameras["front"][0]
        x, y = 80.5, 32.5  # a pixel's centre, through both lenses
        a, b = (x - frame["cx"]) / frame["fl_x"], (y - frame["cy"]) / frame["fl_y"]
        s = a * a + b * b
        u, v = (lens["f" + k] * of * (1 - 0.2 * s + 0.02 * s * s) + lens["c" + k] for k, of in (("x", a), ("y", b)))
        self.assertGreater(x - u, 1.5)
        near = source[int(v) - 1:int(v) + 2, int(u) - 1:int(u) + 2].reshape(-1, 3)
        self.assertTrue(bool(((picture[32, 80] >= near.min(0)) & (picture[32, 80] <= near.max(0))).all()))

    def test_labels_of_a_segmentation_are_taken_with_their_table(self):
        folder, labels = self.log("nuscenes"), self.path("labels")
        data = read_json(os.path.join(folder, "v1.0-trainval", "sample_data.json"))
        numbers = LabelTable("cityscapes").first_numbers(0)
        for camera, (sensor, frames) in self.truth.cameras.items():
            own = sorted((d for d in data if f"/CAM_{camera.upper()}/" in d["filename"]), key=lambda d: d["timestamp"])
            os.makedirs(os.path.join(labels, "CAM_" + camera.upper()))
            for d, frame in zip(own, frames):
                half = np.array(Image.open(frame.label))[::2, ::2]  # a network's pictures may be smaller
                name = os.path.basename(d["filename"])[:-4]
                Image.fromarray(numbers[half]).save(os.path.join(labels, "CAM_" + camera.upper(), name + ".png"))
        drive = self.run_logs(folder, self.path("labelled"), "--labels", labels, "--map", "cityscapes", "--cameras",
                              "CAM_FRONT")
        frame = self.truth.cameras["front"][1][4]
        found = np.array(Image.open(os.path.join(drive, "label", "000004.png")))
        truth = np.array(Image.open(frame.label))[::2, ::2].repeat(2, 0).repeat(2, 1)
        self.assertGreater(float((found == np.where(truth == 19, 255, truth)).mean()), 0.95)
        with self.assertRaises(SystemExit) as refused:
            self.run_logs(folder, self.path("wrong"), "--labels", labels, "--map", "ours", "--cameras", "CAM_FRONT")
        self.assertIn("the table ours has no", str(refused.exception))

    def test_frames_are_chosen_by_number_and_other_input_is_refused(self):
        folder = self.log("pandaset")
        drive = self.run_logs(folder, self.path("some"), "--frames", "2:4", "--cameras", "front_camera")
        frames = read_json(os.path.join(drive, "transforms.json"))["frames"]
        self.assertEqual([frame["file_path"] for frame in frames], [f"color/{n:06d}.png" for n in range(3)])
        before = os.path.getmtime(os.path.join(drive, "color", "000000.png"))
        self.run_logs(folder, self.path("some"), "--frames", "2:4", "--cameras", "front_camera")
        self.assertEqual(os.path.getmtime(os.path.join(drive, "color", "000000.png")), before)
        with self.assertRaises(SystemExit) as refused:
            self.run_logs(folder, self.path("some"), "--frames", "2:5", "--cameras", "front_camera")
        self.assertIn("was made with frames", str(refused.exception))
        os.makedirs(self.path("mine", "drive", "photos"))
        with self.assertRaises(SystemExit) as refused:
            self.run_logs(folder, self.path("mine"))
        self.assertIn("not of this recipe", str(refused.exception))
        self.assertTrue(os.path.isdir(self.path("mine", "drive", "photos")))

    def test_depth_and_sweeps_lead_to_a_scene_and_pairs_to_train_on(self):
        for layout, size, cameras in (("infinicube", (288, 192), ["front", "left"]),
                                      ("kitti360", SIZE, ["image_00", "image_01"])):
            out = self.path("pairs", layout)

            def run(*more):
                quietly(run_logs, [self.log(layout), "-o", out, "-W", str(size[0]), "-H", str(size[1]), *more])
            run()
            grids = find_grids([os.path.join(out, "scene")])
            self.assertEqual([os.path.basename(path) for path in grids], ["voxfield.sgrid"])
            self.assertGreater(len(read_grid(grids[0])[0]["cells"]), 50)
            drives = find_drives(os.path.join(out, "drive"))
            self.assertEqual([os.path.basename(drive.folder) for drive in drives], cameras)
            for drive in drives:
                self.assertEqual(drive.numbers, list(range(MOMENTS if layout == "infinicube" else MOMENTS // 2)))
                self.assertEqual(sorted(drive.of_used), drive.numbers)
                self.assertEqual(drive.splat_radius(), "auto")
                self.check_buffer(drive, drive.numbers[-1])
            kept = grids[0], os.path.join(out, "drive", "buffer", "done")
            times = [os.path.getmtime(path) for path in kept]
            run()
            self.assertEqual([os.path.getmtime(path) for path in kept], times)
            with self.assertRaises(SystemExit) as refused:
                run("--visible", "splats")
            self.assertIn("was made with visible sky", str(refused.exception))

    def check_buffer(self, drive, number):
        """it is like the picture where splats are, and visible what is not sky"""
        buffer, truth = drive.buffer(number).float(), drive.truth(number).float()
        covered = (buffer.sum(0) > 60) & (drive.used(number)[0] != 0)
        self.assertGreater(float(covered.float().mean()), 0.05)
        near = float((buffer - truth).abs().mean(0)[covered].mean())
        far = float((buffer - truth.roll(truth.shape[2] // 3, 2)).abs().mean(0)[covered].mean())
        self.assertLess(near, 0.7 * far)
        labels = np.array(Image.open(os.path.join(drive.folder, "label", f"{number:06d}.png")))
        np.testing.assert_array_equal(drive.visible(number)[0].numpy(), labels != SKY)
        self.assertTrue(0.05 < (labels == SKY).mean() < 0.8)

    def test_frames_of_nuscenes_are_samples(self):
        drive = self.run_logs(self.log("nuscenes"), self.path("sample"), "--frames", "1:1", "--cameras", "CAM_FRONT")
        times = [frame["time"] for frame in read_json(os.path.join(drive, "transforms.json"))["frames"]]
        self.assertEqual(len(times), 2)  # that of the sample, and the one 0.05 s before
        with self.assertRaises(SystemExit) as refused:
            self.run_logs(self.log("nuscenes"), self.path("samples"), "--frames", "1:2")
        self.assertIn("frames are samples 0 to 1", str(refused.exception))

    def check_refused(self, layout, damage, *words):
        """of a copy of a log that `damage(folder)` changed"""
        broken = self.path("broken")
        shutil.copytree(self.log(layout), broken)
        try:
            damage(broken)
            with self.assertRaises(SystemExit) as refused:
                self.run_logs(broken, self.path("broken_out"))
            for word in words:
                self.assertIn(word, str(refused.exception))
        finally:
            shutil.rmtree(broken)
            shutil.rmtree(self.path("broken_out"), ignore_errors=True)

    def test_broken_logs_are_refused_by_the_name_of_the_file(self):
        def cut(*name):
            def damage(folder):
                path = os.path.join(folder, *name)
                with open(path, "r+b") as file:
                    file.truncate(os.path.getsize(path) // 2 + 1)
            return damage

        def removed(*name):
            return lambda folder: os.remove(os.path.join(folder, *name))

        sequence = "2013_05_28_drive_0000_sync"
        cases = [
            ("pandaset", cut("lidar", "poses.json"), "poses.json: broken JSON"),
            ("pandaset", removed("lidar", "timestamps.json"), "timestamps.json is missing"),
            ("pandaset", removed("lidar", "03.pkl.gz"), "03.pkl.gz is missing"),
            ("pandaset", cut("lidar", "03.pkl.gz"), "03.pkl.gz: not a whole table"),
            ("pandaset", removed("camera", "left_camera", "07.jpg"), "left_camera: counts differ"),
            ("pandaset", cut("camera", "left_camera", "07.jpg"), "07.jpg: not a whole picture"),
            ("nuscenes", cut("v1.0-trainval", "ego_pose.json"), "ego_pose.json: broken JSON"),
            ("nuscenes", removed("v1.0-trainval", "sensor.json"), "sensor.json is missing"),
            ("kitti360", cut("calibration", "calib_cam_to_velo.txt"), "calib_cam_to_velo.txt: expected 12"),
            ("kitti360", cut("data_poses", sequence, "poses.txt"), "poses.txt: expected 13"),
            ("kitti360", removed("data_3d_raw", sequence, "velodyne_points", "timestamps.txt"), "timestamps.txt is"),
            ("kitti360", cut("data_3d_raw", sequence, "velodyne_points", "data", "0000000004.bin"), "0000000004.bin"),
            ("kitti360", cut("data_3d_bboxes", "train", sequence + ".xml"), ".xml: broken XML"),
            ("infinicube", removed("intrinsic", "clip.tar"), "clip.tar is missing"),
            ("infinicube", cut("image_left", "clip.tar"), "image_left", "clip.tar"),
        ]
        for layout, damage, *words in cases:
            with self.subTest(layout, words=words):
                self.check_refused(layout, damage, *words)

    def test_a_folder_of_no_layout_is_refused_with_what_was_expected(self):
        with self.assertRaises(SystemExit) as refused:
            self.run_logs(self.path("street"), self.path("nothing"))
        self.assertIn("found no layout; expected one of", str(refused.exception))


class Lenses(unittest.TestCase):

    def test_the_fisheye_is_that_of_kitti_360s_scripts(self):
        """their formula without the tangential part, which they leave out"""
        lens = Mei(1400, 1400, 2.2134, 0.0168, 1.6548, 0, 0, 1336.3, 1335.8, 716.9, 705.8)
        ray = np.array([0.3, -0.2, 0.9])
        x, y, z = ray / np.linalg.norm(ray)
        x, y = x / (z + lens.xi), y / (z + lens.xi)
        r = x * x + y * y
        factor = 1 + lens.k1 * r + lens.k2 * r * r
        expected = lens.gamma1 * x * factor + lens.u0, lens.gamma2 * y * factor + lens.v0
        np.testing.assert_allclose(lens.project(ray[0] / ray[2], ray[1] / ray[2]), expected, rtol=1e-12)

    def test_distorted_pictures_become_pinholes_without_black_borders(self):
        for distortion in ((-0.2, 0.02, 0.001, -0.001, 0), (0.2, 0.05, 0, 0, 0.01)):
            lens = OpenCv(128, 96, 90, 91, 65, 47, distortion)
            undistortion = Undistortion(lens, 64, 44)
            x, y = np.meshgrid(np.arange(128) + 0.5, np.arange(96) + 0.5)
            ramp = np.stack([x, y, np.full_like(x, 255)], -1).round().astype(np.uint8)
            picture = undistortion.picture(ramp, "here")
            self.assertEqual(int(picture[..., 2].min()), 255)
            u, v = lens.project(*rays_of(undistortion.target, undistortion.x, undistortion.y))
            self.assertLess(float(np.abs(picture[..., 0] - u).max()), 1.01)  # pixel c holds c + 0.5, rounded to even
            self.assertLess(float(np.abs(picture[..., 1] - v).max()), 1.01)
            self.assertTrue(((u > 0) & (u < 128) & (v > 0) & (v < 96)).all())

    def test_a_smaller_picture_has_the_mean_of_the_pixels_it_covers(self):
        random = np.random.default_rng(1).integers(0, 256, (32, 48, 3)).astype(np.uint8)
        small = Undistortion(OpenCv(48, 32, 40, 40, 24, 16), 16, 8).picture(random, "here")  # 24 of 32 rows
        mean = random[4:28].reshape(8, 3, 16, 3, 3).mean((1, 3))
        self.assertLessEqual(float(np.abs(small - mean).max()), 0.5 + 1e-4)

    def test_poses_between_and_beyond_are_even(self):
        motion = Motion([0, 2], [rigid([0, 0, 0], [1, 0, 0, 0]), rigid([4, 0, 2], [0.5 ** 0.5, 0, 0, 0.5 ** 0.5])])
        for time, degrees in ((1, 45), (3, 135), (-1, -45)):
            pose = motion.at(time)
            np.testing.assert_allclose(pose[:3, 3], [2 * time, 0, time], atol=1e-12)
            self.assertAlmostEqual(np.degrees(np.arctan2(pose[1, 0], pose[0, 0])), degrees)

    def test_a_box_beside_and_behind_the_camera_hides_what_it_covers(self):
        lens, middle = OpenCv(64, 48, 32, 32, 32, 24), np.eye(4)
        ahead = rigid([0, 0, 4], np.eye(3))
        used = used_picture(middle, lens, [(ahead, np.ones(3))])  # its front is at 3 m: 32 / 3 pixels each way
        self.assertIn(int((used[24] == 0).sum()), (21, 22, 23))
        self.assertEqual(used_picture(middle, lens, [(rigid([0, 0, -4], np.eye(3)), np.ones(3))]).min(), 255)
        around = used_picture(middle, lens, [(rigid([2, 0, 0], np.eye(3)), np.array([1.0, 1, 5]))])
        self.assertEqual((int(around[24, 0]), int(around[24, 63])), (255, 0))

    def test_a_thing_is_where_it_was_seen_and_as_long_as_that(self):
        track = Track(np.ones(3), Motion([1.0, 2.0], [rigid([x, 0, 0], np.eye(3)) for x in (0, 4)]), 0.5)
        self.assertEqual(len(moving_boxes([track], 0.0, 0.4)), 0)
        self.assertEqual(len(moving_boxes([track], 2.6, 9.0)), 0)
        self.assertEqual([pose[0, 3] for pose, _ in moving_boxes([track], 0.0, 2.0)], [-2, 0, 2, 4])

    def test_what_moves_less_than_half_a_metre_stands(self):
        for metres, moves in ((0.4, False), (0.6, True)):
            track = Track(np.ones(3), Motion([0, 1], [np.eye(4), rigid([metres, 0, 0], np.eye(3))]), 0.1)
            self.assertEqual(track.moves(), moves)


if __name__ == "__main__":
    if "--print" in sys.argv:
        Logs.setUpClass()
        for name in LAYOUTS:
            print(name, {k: float(v) for k, v in Logs.errors(name).items()})
            if name != "infinicube":
                print(" ", {k: float(v) for k, v in Logs.point_errors(name).items() if k != "labels"})
        Logs.tearDownClass()
    else:
        unittest.main()

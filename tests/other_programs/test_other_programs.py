# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What other programs make of our files, and we of theirs. A program that is not installed skips its tests by name.
Python's own tarfile is one of them.

Programs: colmap, pcl-tools, python3-opencv, python3-open3d and python3-skimage of Debian (tools/setup --programs); of
npm, gltf-validator and @playcanvas/splat-transform in the folder NODE_MODULES.
"""
import importlib
import json
import math
import os
import shutil
import struct
import subprocess
import tarfile
import tempfile
import unittest
from pathlib import Path

SEMROVER = os.environ.get("SEMROVER", "semrover")
SCENES = Path(__file__).resolve().parents[2] / "assets" / "scenes"
MODULES = Path(os.environ.get("NODE_MODULES", "node_modules"))

VALIDATE = """
const fs = require('fs'), validator = require(process.argv[1]);
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])), {maxIssues: 100})
    .then(report => console.log(JSON.stringify(report.issues)));
"""


def run(*arguments):
    result = subprocess.run([str(a) for a in arguments], capture_output=True, text=True, timeout=600)
    if result.returncode != 0:
        raise AssertionError(f"{arguments[0]} {arguments[1]}: exit code {result.returncode}: {result.stderr[-2000:]}")
    return result.stdout


def needs_module(name):
    return unittest.skipUnless(shutil.which("node") and (MODULES / name).is_dir(),
                               f"no {name} in {MODULES}: NODE_MODULES says where npm put it")


def needs_program(name):
    return unittest.skipUnless(shutil.which(name), f"{name} is not installed")


def skimage_metrics():
    try:
        from skimage import metrics
        return metrics
    except ImportError:
        return None


def python_module(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def needs_python(name):
    return unittest.skipUnless(python_module(name), f"{name} is not installed")


class Case(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)


def splat(position, scale=(0.5, 0.1, 1e-4), color=(200, 100, 50, 255), rotation=(255, 128, 128, 128)):
    return struct.pack("<6f8B", *position, *scale, *color, *rotation)


class Gltf(Case):
    def issues(self, path):
        report = run("node", "-e", VALIDATE, (MODULES / "gltf-validator").resolve(), path)
        # errors and warnings, but for attributes of an extension that the validator does not know yet
        return [m for m in json.loads(report)["messages"] if m["severity"] < 2 and not
                (m["code"] == "MESH_PRIMITIVE_INVALID_ATTRIBUTE" and "/KHR_gaussian_splatting:" in m["pointer"])]

    @needs_module("gltf-validator")
    def test_splats(self):
        source = self.folder / "a.splat"
        source.write_bytes(splat((1, 2, 3)) + splat((-4, 5, 0.5), rotation=(200, 160, 100, 90)))
        run(SEMROVER, "convert", "-q", source, self.folder / "a.glb")
        self.assertEqual(self.issues(self.folder / "a.glb"), [])

    @needs_module("gltf-validator")
    def test_mesh_of_a_street(self):
        run(SEMROVER, "streets", "-q", "--no-grids", "--length", 40, "--spacing", 100, "-o", self.folder / "street")
        self.assertEqual(self.issues(self.folder / "street" / "mesh.glb"), [])

    @needs_module("gltf-validator")
    def test_mesh_of_depth_images(self):
        path = self.folder / "two.tum"
        path.write_text("0 1 0 1.7 -0.5 0.5 -0.5 0.5\n1 2 0 1.7 -0.5 0.5 -0.5 0.5\n")
        frames = self.folder / "frames"
        run(SEMROVER, "render", "-q", SCENES / "street.truth.sgrid", "--path", path, "-W", 96, "-H", 64,
            "--splat-radius", "auto", "-o", frames)
        run(SEMROVER, "fuse", "-q", frames, "--poses", path, "--fov-x", 73, "--tsdf-voxel", 0.3,
            "-o", self.folder / "fused")
        self.assertEqual(self.issues(self.folder / "fused" / "mesh.glb"), [])


class Shards(Case):
    def test_python_reads_the_archives_that_the_index_describes(self):
        source, packed = self.folder / "in", self.folder / "set"
        for moment in range(7):
            for camera in "front", "left.up":
                for kind in "color", "depth":
                    path = source / camera / kind / f"{moment:06}.png"
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(os.urandom(moment * 511))
        run(SEMROVER, "dataset", "pack", "-q", source, "-o", packed, "--key", "S_D_", "--shard-size", "12k")
        index = json.loads((packed / "index.json").read_text())
        self.assertGreater(len(index["shards"]), 1)
        samples = {}  # as WebDataset takes them: the files of one name up to its first dot
        for shard in index["shards"]:
            with tarfile.open(packed / shard["file"], "r:") as archive:
                members = archive.getmembers()
                self.assertEqual(len(members), len(shard["members"]))
                for found, (path, offset, size, _) in zip(members, shard["members"]):
                    self.assertEqual((found.offset_data, found.size), (offset, size))
                    self.assertEqual((found.type, found.mode, found.mtime, found.uid, found.gid, found.uname),
                                     (tarfile.REGTYPE, 0o644, 0, 0, 0, ""))
                    self.assertEqual(archive.extractfile(found).read(), (source / path).read_bytes())
                    key, field = found.name.split(".", 1)
                    self.assertEqual(samples.setdefault(key, shard["file"]), shard["file"])
                    camera, kind, name = path.split("/")
                    self.assertEqual((key, field), ("S_D_" + name[:6], f"{camera}.{kind}.png"))
        self.assertEqual(sorted(samples), [f"S_D_{moment:06}" for moment in range(7)])


class Lidar(Case):
    """a sweep in each format, against the array of all fields"""

    def setUp(self):
        super().setUp()
        path, rig = self.folder / "two.tum", self.folder / "rig.json"
        path.write_text("0 8 0 1.7 -0.5 0.5 -0.5 0.5\n0.1 9 0.1 1.7 -0.5 0.5 -0.5 0.5\n")
        rig.write_text(json.dumps({"sensors": [{"name": "top", "lidar": "xt32", "sensor_to_vehicle": {
            "translation": [0, 0, 0.3], "rotation": [0, 0, 0, 1]}}]}))
        for name in "npy", "pcd", "kitti", "nuscenes":
            run(SEMROVER, "render", "-q", SCENES / "street.truth.sgrid", "--path", path, "--rig", rig, "--splat-radius",
                "auto", "--lidar-format", name, "-o", self.folder / name)

    def points(self, name, ending):
        return self.folder / name / "top" / "points" / f"000001.{ending}"

    @needs_python("numpy")
    def test_numpy_reads_them(self):
        import numpy
        own = numpy.load(self.points("npy", "npy"))
        self.assertEqual((own.dtype, own.shape[1]), (numpy.float32, 8))
        self.assertGreater(len(own), 10000)
        kitti = numpy.fromfile(self.points("kitti", "bin"), dtype=numpy.float32).reshape(-1, 4)
        self.assertTrue((kitti == own[:, :4]).all())
        # as nuscenes-devkit's LidarPointCloud.from_file does
        nuscenes = numpy.fromfile(self.points("nuscenes", "pcd.bin"), dtype=numpy.float32).reshape(-1, 5)
        self.assertTrue((nuscenes[:, [0, 1, 2, 4]] == own[:, [0, 1, 2, 4]]).all())
        self.assertTrue(numpy.allclose(nuscenes[:, 3], own[:, 3] * 255))

    @needs_python("open3d")
    def test_open3d_reads_all_fields_of_pcd(self):
        import numpy
        import open3d
        own = numpy.load(self.points("npy", "npy"))
        cloud = open3d.t.io.read_point_cloud(str(self.points("pcd", "pcd"))).point
        self.assertTrue((cloud["positions"].numpy() == own[:, :3]).all())
        for column, name in enumerate(("intensity", "ring", "t", "label", "instance"), 3):
            self.assertTrue((cloud[name].numpy().ravel() == own[:, column]).all(), name)
        plain = open3d.io.read_point_cloud(str(self.points("pcd", "pcd")))
        self.assertTrue((numpy.asarray(plain.points) == own[:, :3]).all())

    @needs_program("pcl_convert_pcd_ascii_binary")
    @needs_python("numpy")
    def test_pcl_reads_pcd(self):
        import numpy
        own = numpy.load(self.points("npy", "npy"))
        text = self.folder / "text.pcd"
        run("pcl_convert_pcd_ascii_binary", self.points("pcd", "pcd"), text, 0)
        lines = text.read_text().splitlines()
        self.assertIn("FIELDS x y z intensity ring label t instance", lines)
        rows = numpy.array([line.split() for line in lines[lines.index("DATA ascii") + 1:]], dtype=numpy.float64)
        self.assertTrue(numpy.allclose(rows[:, [0, 1, 2, 3, 4, 6, 5, 7]], own, rtol=1e-4, atol=1e-4))


class Viewers(Case):
    @needs_module("@playcanvas/splat-transform")
    def test_up_y_is_what_a_glb_shows(self):
        # a splat 10 m ahead, one 5 m to the left of it and one 2 m above it
        source = self.folder / "a.splat"
        source.write_bytes(b"".join(splat(p) for p in [(10, 0, 0), (10, 5, 0), (10, 0, 2)]))
        for name, extension in [("a.ply", []), ("b.splat", [])]:
            written, shown = self.folder / name, self.folder / (name + ".glb")
            run(SEMROVER, "convert", "-q", source, written, "--up", "y", *extension)
            run("node", MODULES / "@playcanvas" / "splat-transform" / "bin" / "cli.mjs", "-q", "-w", written, shown)
            # glTF: x right, y up, z back
            for found, expected in zip(gltf_positions(shown), [(0, 0, -10), (-5, 0, -10), (0, 2, -10)]):
                for a, b in zip(found, expected):
                    self.assertAlmostEqual(a, b, places=4)
            # and as our own reader has it
            run(SEMROVER, "convert", "-q", shown, self.folder / (name + ".back.splat"))
            back = (self.folder / (name + ".back.splat")).read_bytes()
            places = [struct.unpack_from("<3f", back, 32 * i) for i in range(3)]
            for found, expected in zip(places, [(10, 0, 0), (10, 5, 0), (10, 0, 2)]):
                for a, b in zip(found, expected):
                    self.assertAlmostEqual(a, b, places=4)


def gltf_positions(path):
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20:20 + size]), 20 + size + 8
    accessor = document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    view = document["bufferViews"][accessor["bufferView"]]
    start = binary + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride", 12)
    places = [struct.unpack_from("<3f", data, start + i * stride) for i in range(accessor["count"])]
    root = document["nodes"][document["scenes"][0]["nodes"][0]]
    if "matrix" in root or "rotation" in root or "scale" in root or "translation" in root:
        raise AssertionError(f"a node that is turned: {root}")
    return places


class Colmap(Case):
    @needs_program("colmap")
    def test_it_reads_our_text_and_we_read_its_binary_model(self):
        for model, more in [("pinhole", []), ("opencv", ["--distortion=-0.1,0.02,0.001,0.002"]),
                            ("fisheye", ["--distortion=0.05,0.01,0,0", "--fov-x", "150"])]:
            ours, binary, text = (self.folder / f"{model}.{kind}" for kind in ("text", "binary", "back"))
            run(SEMROVER, "convert", "-q", SCENES / "street.tum", ours, "--path-format", "colmap", "-W", 640, "-H", 480,
                "--camera-model", model, *more)
            binary.mkdir()
            run("colmap", "model_converter", "--input_path", ours, "--output_path", binary, "--output_type", "BIN")
            self.assertFalse((binary / "cameras.txt").exists())
            for source, name in [(ours, "a"), (binary, "b")]:
                run(SEMROVER, "convert", "-q", source, self.folder / f"{model}.{name}.json")
            a, b = (json.loads((self.folder / f"{model}.{name}.json").read_text()) for name in "ab")
            self.assertEqual(len(b["frames"]), 24)
            for key in a:
                if key != "frames":
                    self.assertAlmostEqual(a[key], b[key], places=9) if isinstance(a[key], float) else \
                        self.assertEqual(a[key], b[key])
            for one, other in zip(a["frames"], b["frames"]):
                for row, expected in zip(other["transform_matrix"], one["transform_matrix"]):
                    for x, y in zip(row, expected):
                        self.assertAlmostEqual(x, y, places=9)


RIG = {"sensors": [
    {"name": "front", "width": 320, "height": 200, "fov": 90,
     "sensor_to_vehicle": {"translation": [0.3, 0, 0], "rotation": [-0.5, 0.5, -0.5, 0.5]}},
    {"name": "left", "width": 240, "height": 200, "fov": 80,
     "sensor_to_vehicle": {"translation": [0, 0.2, 0], "rotation": [-0.270598, 0.653281, -0.653281, 0.270598]}}]}


class DataSets(Case):
    """A drive as `dataset export` writes it, read by others"""
    def setUp(self):
        super().setUp()
        scene, drive = SCENES / "avenue.truth.sgrid", self.folder / "drive"
        lines = [line for line in (SCENES / "avenue.tum").read_text().splitlines() if not line.startswith("#")]
        (self.folder / "path.tum").write_text("\n".join(lines[::8]) + "\n")
        (self.folder / "rig.json").write_text(json.dumps(RIG))
        run(SEMROVER, "convert", "-q", scene, self.folder / "guessed.objects.json", "-m", SCENES.parent / "model")
        run(SEMROVER, "render", "-q", scene, "--path", self.folder / "path.tum", "--rig", self.folder / "rig.json",
            "--splat-radius", "auto", "--objects", self.folder / "guessed.objects.json", "--boxes", "--points",
            "-o", drive)
        self.drive, self.poses = drive, len(lines[::8])

    def export(self, layout, *more):
        run(SEMROVER, "dataset", "export", "-q", self.drive, "--to", layout, "-o", self.folder / layout, *more)
        return self.folder / layout

    @needs_python("cv2")
    def test_opencv_projects_kittis_boxes_to_where_labels_say(self):
        import cv2
        import numpy as np
        training = self.export("kitti") / "training"
        compared = 0
        for label in sorted((training / "label_2").glob("*.txt")):
            image = cv2.imread(str(training / "image_2" / label.with_suffix(".png").name))
            self.assertEqual(image.shape, (200, 320, 3))
            calibration = dict(line.split(": ") for line in (training / "calib" / label.name).read_text().splitlines())
            p2 = np.array(calibration["P2"].split(), float).reshape(3, 4)
            for line in label.read_text().splitlines():
                v = np.array(line.split()[1:], float)
                (h, w, l), place, turn = v[7:10], v[10:13], v[13]
                x = np.array([1, 1, -1, -1] * 2) * l / 2
                y = np.array([0] * 4 + [-h] * 4)
                z = np.array([1, -1, -1, 1] * 2) * w / 2
                rotation = cv2.Rodrigues(np.array([0, turn, 0]))[0]
                corners = (rotation @ np.array([x, y, z])).T + place
                if corners[:, 2].min() < 0.3:
                    continue
                found = cv2.projectPoints(corners, np.zeros(3), np.zeros(3), p2[:, :3], None)[0].reshape(-1, 2)
                box = np.concatenate([found.min(0), found.max(0)]).clip(0, [319, 199] * 2)
                self.assertLess(np.abs(box - v[3:7]).max(), 0.1, line)  # both rounded to what files have
                compared += 1
        self.assertGreater(compared, 5)

    @needs_python("open3d")
    def test_open3d_makes_the_scene_of_depths_lenses_and_poses(self):
        import numpy as np
        import open3d as o3d
        folder = self.export("transforms")
        cameras = json.loads((folder / "transforms.json").read_text())
        scene = o3d.io.read_point_cloud(str(folder / cameras["ply_file_path"]))
        tree = o3d.geometry.KDTreeFlann(scene)
        distances = []
        for frame in cameras["frames"]:
            # Open3D counts pixels from the centre of the first
            lens = o3d.camera.PinholeCameraIntrinsic(frame["w"], frame["h"], frame["fl_x"], frame["fl_y"],
                                                     frame["cx"] - 0.5, frame["cy"] - 0.5)
            to_world = np.array(frame["transform_matrix"]) @ np.diag([1, -1, -1, 1])
            depth = o3d.io.read_image(str(folder / frame["depth_file_path"]))
            points = o3d.geometry.PointCloud.create_from_depth_image(
                depth, lens, np.linalg.inv(to_world), depth_scale=1 / cameras["depth_unit_scale_factor"],
                depth_trunc=20.0, stride=7)
            for point in np.asarray(points.points):
                distances.append(math.sqrt(tree.search_knn_vector_3d(point, 1)[2][0]))
        self.assertGreater(len(distances), 5000)
        self.assertLess(np.median(distances), 0.06)  # points of the scene are 0.1 m apart

    @needs_program("colmap")
    def test_colmap_reads_the_model_and_finds_its_pictures(self):
        folder = self.export("colmap")
        (self.folder / "binary").mkdir()
        run("colmap", "model_converter", "--input_path", folder / "sparse" / "0", "--output_path",
            self.folder / "binary", "--output_type", "BIN")
        lines = (folder / "sparse" / "0" / "images.txt").read_text().splitlines()
        names = [line.split()[9] for line in lines if len(line.split()) == 10 and not line.startswith("#")]
        self.assertEqual(len(names), 2 * self.poses)
        for name in names:
            self.assertTrue((folder / "images" / name).is_file())


class Skimage(Case):
    @unittest.skipUnless(skimage_metrics(), "skimage is not installed")
    def test_psnr_and_ssim_are_the_same(self):
        import numpy as np
        from PIL import Image
        random = np.random.default_rng(3)
        a = np.clip(random.normal(128, 40, (57, 83, 3)), 0, 255).astype(np.uint8)
        for name, spread in [("near", 3), ("far", 60)]:
            b = np.clip(a + random.normal(0, spread, a.shape), 0, 255).astype(np.uint8)
            for folder, image in [("frames", a), ("truth", b)]:
                (self.folder / name / folder).mkdir(parents=True)
                Image.fromarray(image).save(self.folder / name / folder / "000000.png")
            ours = json.loads(run(SEMROVER, "eval", "frames", self.folder / name / "frames",
                                  self.folder / name / "truth", "--json"))
            metrics = skimage_metrics()
            luma = [image.astype(np.float64) @ [0.299, 0.587, 0.114] for image in (a, b)]
            ssim = metrics.structural_similarity(*luma, win_size=11, gaussian_weights=True, sigma=1.5,
                                                 use_sample_covariance=False, data_range=255)
            psnr = metrics.peak_signal_noise_ratio(b, a, data_range=255)
            self.assertAlmostEqual(ours["psnr"], psnr, places=6)
            self.assertAlmostEqual(ours["ssim"], ssim, places=6)
            self.assertTrue(math.isfinite(psnr))


class OpenCv(Case):
    @needs_python("cv2")
    def test_dots_are_where_it_projects_them_through_a_thin_prism(self):
        import numpy
        places = [(5, y, z) for y in (-2.4, -0.9, 0.7, 2.2) for z in (-1.3, 0.1, 1.4)]  # ahead: x forward, y left, z up
        source = self.folder / "dots.splat"
        source.write_bytes(b"".join(splat(p, (1e-3, 1e-3, 1e-4), (255, 255, 255, 255)) for p in places))
        k = (-0.28, 0.09, 0.0012, -0.0007, -0.011, 0.05, -0.02, 0.004, 0.0031, -0.0012, -0.0024, 0.0008)
        rig = {"sensors": [{"name": "a", "model": "opencv", "width": 640, "height": 480, "fx": 400, "fy": 410,
                            "cx": 322.5, "cy": 237.25, "distortion": k,
                            "sensor_to_vehicle": {"rotation": (-0.5, 0.5, -0.5, 0.5)}}]}
        (self.folder / "rig.json").write_text(json.dumps(rig))
        (self.folder / "path.tum").write_text("0 0 0 0 -0.5 0.5 -0.5 0.5\n")
        run(SEMROVER, "render", "-q", source, "--path", self.folder / "path.tum", "--rig", self.folder / "rig.json", "-o",
            self.folder / "out")
        image = python_module("cv2").imread(str(self.folder / "out/a/color/000000.png"))[:, :, 0].astype(float)
        points = numpy.array([(-y, -z, x) for x, y, z in places], dtype=float)
        # the centre of OpenCV's first pixel is at (0, 0), ours at (0.5, 0.5)
        matrix = numpy.array([[400, 0, 322.5 - 0.5], [0, 410, 237.25 - 0.5], [0, 0, 1]])
        expected, _ = python_module("cv2").projectPoints(points, numpy.zeros(3), numpy.zeros(3), matrix, numpy.array(k))
        for x, y in expected.reshape(-1, 2):
            left, top = round(x) - 6, round(y) - 6
            block = image[top:top + 13, left:left + 13]
            rows, columns = numpy.mgrid[top:top + 13, left:left + 13]
            self.assertGreater(block.sum(), 100)
            self.assertAlmostEqual((columns * block).sum() / block.sum(), x, delta=0.03)
            self.assertAlmostEqual((rows * block).sum() / block.sum(), y, delta=0.03)


if __name__ == "__main__":
    unittest.main()

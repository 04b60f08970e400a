# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Latents: encoded in batches, kept in files of a few frames, mapped to memory; of what the program writes."""
import contextlib
import io
import os
import shutil
import unittest
from unittest import mock

import torch

from semtrain import asd, latents, model_folder, processes, safetensors_file
from semtrain.content import digest_of_pictures
from semtrain.frames import find_drives, find_made_drives
from semtrain.json_file import write_json
from semtrain.nets.vae import AutoencoderKL
from semtrain.program import engine_path, semrover
from test_recipes_asd import ASD, VAE, draw_drive, put_radius
from test_runs import InAFolder
from test_transformer import write_street

LOOK = {"translation": [0, 0, 0], "rotation": [-0.5, 0.5, -0.5, 0.5]}
RIG = {"path_axes": "vehicle", "sensors": [
    {"name": name, "model": "pinhole", "width": width, "height": height, "fov": 90, "sensor_to_vehicle": LOOK}
    for name, width, height in (("front", 48, 32), ("wide", 64, 24))]}


class WithAVae(InAFolder):
    def setUp(self):
        super().setUp()
        torch.set_num_threads(1)
        torch.manual_seed(1)
        self.vae = AutoencoderKL(VAE).eval()
        model_folder.write_component(self.path("vae"), self.vae.config_json(), self.vae.state_dict())
        self.vae = latents.load_vae(self.path("vae"))  # with rounded weights

    def sequences(self, cache="cache", batch=1, **more):
        with contextlib.redirect_stdout(io.StringIO()):
            return latents.sequences(self.path("vae"), find_drives(self.path("frames")), self.path(cache),
                                     {"device": "cpu", "encode_batch": batch}, **more)

    def tensors(self, *arguments, **more):
        return [of[:] for s in self.sequences(*arguments, **more) for of in (s.truth, s.buffer, s.visible)]


class Encoding(WithAVae):
    def setUp(self):
        super().setUp()
        for i in range(2):
            draw_drive(self.path("frames", str(i)), i)  # of three frames
        shorter = mock.patch.object(latents, "FRAMES", 2)
        shorter.start()
        self.addCleanup(shorter.stop)

    def test_goes_on_after_a_kill_with_what_is_left(self):
        whole = self.tensors()
        files = sorted(os.listdir(self.path("cache")))
        self.assertEqual(len(files), 8)  # two drives and their mirror images, of 2 frames and of 1
        encode, done = latents.Encoder.encode, []

        def counted(encoder, drive, numbers, flip):
            done.append(numbers)
            if len(done) == 6:
                raise KeyboardInterrupt
            return encode(encoder, drive, numbers, flip)
        with mock.patch.object(latents.Encoder, "encode", counted):
            with self.assertRaises(KeyboardInterrupt):
                self.tensors("killed")
            again = self.tensors("killed")
        self.assertEqual(len(done), 6 + 3)
        self.assertEqual(sorted(os.listdir(self.path("killed"))), files)
        self.assertEqual([i for i, (a, b) in enumerate(zip(whole, again)) if not torch.equal(a, b)], [])

    def test_in_batches_gives_what_one_at_a_time_gives(self):
        sizes, encode = [], AutoencoderKL.encode_scaled

        def counted(vae, pictures):
            sizes.append(len(pictures))
            return encode(vae, pictures)
        with mock.patch.object(AutoencoderKL, "encode_scaled", counted):
            in_batches = self.tensors("batches", batch=4, mirrored=False)
        self.assertEqual(sizes, [2, 2, 1, 1] * 2)  # truths and buffers, in files of 2 and 1
        for found, expected in zip(in_batches, self.tensors("alone", mirrored=False)):
            torch.testing.assert_close(found, expected, atol=1e-5, rtol=1e-5)
        drive = find_drives(self.path("frames"))[1]
        with torch.no_grad():
            expected = self.vae.encode_scaled(drive.truth(2)[None].float() / 127.5 - 1)[0]
        torch.testing.assert_close(in_batches[3][2], expected, atol=1e-5, rtol=1e-5)

    def test_leaves_random_numbers_as_they_were(self):
        torch.manual_seed(5)
        expected = torch.rand(3)
        torch.manual_seed(5)
        self.sequences()
        self.assertTrue(torch.equal(torch.rand(3), expected))

    def test_is_read_by_frames_across_files(self):
        first = self.sequences()[0]
        self.assertEqual((len(first), first.truth.shape), (3, (3, 4, 6, 8)))
        whole = torch.cat([first.truth[i][None] for i in range(3)])
        self.assertEqual(len(first.truth.tensors), 2)
        self.assertTrue(torch.equal(first.truth[1:3], whole[1:3]))
        self.assertTrue(torch.equal(first.truth[:], whole))

    def test_by_processes_is_shared_out_and_known_to_all(self):
        with mock.patch.object(processes, "count", lambda: 2), mock.patch.object(processes, "rank", lambda: 1):
            def gather(out, own):
                out[:] = [["of rank 0"], own]
            with mock.patch.object(processes.distributed, "all_gather_object", gather):
                self.assertEqual(processes.divided(str, [0, 1, 2, 3]), ["of rank 0", "1", "of rank 0", "3"])


class Mapped(InAFolder):
    def test_tensors_are_read_when_they_are_looked_at(self):
        path = self.path("a.safetensors")
        safetensors_file.write(path, {"a": torch.arange(4.0), "b": torch.ones(3, dtype=torch.uint8),
                                      "c": torch.arange(2.0)})
        mapped, copied = safetensors_file.read(path, mapped=True), safetensors_file.read(path)
        for name, tensor in copied.items():
            self.assertTrue(torch.equal(mapped[name], tensor))  # c, behind 3 bytes, is a copy
        start = safetensors_file.read_header(path)[2]
        fresh = safetensors_file.read(path, mapped=True)
        with open(path, "r+b") as file:
            file.seek(start)
            file.write(torch.tensor(7.0).numpy().tobytes())
        self.assertEqual((float(fresh["a"][0]), float(copied["a"][0])), (7, 0))


class WrittenByTheProgram(WithAVae):
    """a rig of two cameras of other sizes, in PNG, in JPEG, and in shard sets"""

    @classmethod
    def setUpClass(cls):
        if not os.access(engine_path(), os.X_OK):
            raise unittest.SkipTest(f"{engine_path()} is not there")

    def setUp(self):
        super().setUp()
        write_street(self.path("street.sgrid"))
        write_json(self.path("rig.json"), RIG)
        with open(self.path("path.tum"), "w") as file:
            file.writelines(f"{i} {0.3 * i - 2} 1.5 1.2 0 0 0 1\n" for i in range(3))
        self.render("png", "frames", "plain")
        for camera in ("front", "wide"):  # something to draw: the picture itself
            shutil.copytree(self.path("frames", "plain", "buffer", camera, "color"),
                            self.path("frames", "plain", camera, "color"))

    def render(self, pictures, *folder):
        semrover("render", self.path("street.sgrid"), "--path", self.path("path.tum"), "--rig", self.path("rig.json"),
                 "--format", pictures, "--quiet", "-o", self.path(*folder, "buffer"))

    def test_each_camera_is_a_drive(self):
        put_radius(self.path("frames", "plain"), 0.05)
        drives = find_drives(self.path("frames"))
        self.assertEqual([os.path.relpath(d.folder, self.path("frames")) for d in drives],
                         ["plain/front", "plain/wide"])
        self.assertEqual([tuple(d.truth(0).shape) for d in drives], [(3, 32, 48), (3, 24, 64)])
        self.assertEqual([(d.numbers, d.splat_radius()) for d in drives], [([0, 1, 2], 0.05)] * 2)
        self.assertTrue(all(torch.equal(d.truth(1), d.buffer(1)) for d in drives))
        self.assertTrue(all(0 < float(d.visible(1).mean()) < 1 for d in drives))
        batches = asd.Batches(self.sequences(), {**ASD, "crop": [99, 99], "batch": 16})
        self.assertEqual(tuple(batches.make(0)[0].shape), (16, 4, 3, 6))  # as much as all cameras have

    def test_jpeg_is_read_like_png(self):
        self.render("jpeg", "frames", "plain2")
        shutil.copytree(self.path("frames", "plain2", "buffer", "front", "color"),
                        self.path("frames", "plain2", "front", "color"))
        png, _, jpeg = find_drives(self.path("frames"))
        self.assertTrue(jpeg.parts[0][0].file.endswith("000000.jpg"))
        self.assertEqual(jpeg.numbers, [0, 1, 2])
        self.assertLess(float((png.truth(2).float() - jpeg.truth(2).float()).abs().mean()), 6)
        self.assertTrue(torch.equal(png.visible(2), jpeg.visible(2)))

    def test_shard_sets_stand_in_place_of_folders(self):
        expected = find_drives(self.path("frames"))
        for packed in ("", "buffer"):  # the drive, or its buffers alone
            root = self.path("packed" + packed)
            shutil.copytree(self.path("frames"), root)
            shutil.rmtree(os.path.join(root, "plain", packed))
            semrover("dataset", "pack", self.path("frames", "plain", packed), "-o", os.path.join(root, "plain", packed))
            drives = find_drives(root)
            self.assertEqual([d.folder for d in drives], [os.path.join(root, "plain", c) for c in ("front", "wide")])
            self.assertTrue(any(p.file.endswith(".tar") for p in drives[0].pictures([1])))
            for drive, of_folder in zip(drives, expected, strict=True):
                numbers = of_folder.numbers
                self.assertEqual(digest_of_pictures(drive.pictures(numbers)),
                                 digest_of_pictures(of_folder.pictures(numbers)))
                self.assertTrue(torch.equal(drive.buffer(2), of_folder.buffer(2)))
        with open(os.path.join(root, "plain", "buffer", "frames-00000.tar"), "r+b") as file:
            file.truncate(1024)
        with self.assertRaisesRegex(SystemExit, "frames-00000.tar: expected [0-9]+ bytes, .* found 1024"):
            find_drives(root)

    def test_recipes_that_render_again_name_what_they_cannot_take(self):
        with self.assertRaisesRegex(SystemExit, "expected .*/plain/front/buffer/color/000000.png, as `run drives`"):
            find_made_drives(self.path("frames"))

    def test_a_picture_in_two_formats_is_refused(self):
        folder = self.path("frames", "plain", "front", "color")
        shutil.copy(os.path.join(folder, "000001.png"), os.path.join(folder, "000001.jpg"))
        with self.assertRaisesRegex(SystemExit, "front/color: picture 1 is there twice"):
            find_drives(self.path("frames"))


if __name__ == "__main__":
    unittest.main()

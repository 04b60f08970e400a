# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
import os
import tempfile
import unittest

import numpy as np
import torch
from PIL import Image

from semtrain.drives import drive_of
from semtrain.frames import fill_blocks, find_drives, psnr, to_floats, to_pixels


def write_frame(folder, number, parts=("color", "buffer/color", "buffer/visible")):
    for part in parts:
        os.makedirs(os.path.join(folder, part), exist_ok=True)
        picture = np.full((8, 16) if part.endswith("visible") else (8, 16, 3), 10 * number, np.uint8)
        Image.fromarray(picture).save(os.path.join(folder, part, f"{number:06d}.png"))


class Frames(unittest.TestCase):
    def test_drives_are_found_at_any_depth_and_in_order(self):
        with tempfile.TemporaryDirectory() as root:
            for place in ("b", "a", "a/shifted"):
                write_frame(os.path.join(root, place), 0)
            os.makedirs(os.path.join(root, "c", "color"))
            found = [os.path.relpath(drive.folder, root) for drive in find_drives(root)]
            self.assertEqual(found, ["a", "a/shifted", "b"])

    def test_a_frame_that_lacks_its_buffer_is_left_out_and_begins_a_new_sequence(self):
        with tempfile.TemporaryDirectory() as root:
            for number in (0, 1, 3, 4):
                write_frame(root, number)
            write_frame(root, 2, parts=("color",))
            drive = find_drives(root)[0]
            self.assertEqual(drive.numbers, [0, 1, 3, 4])
            self.assertEqual([drive.has_previous(n) for n in drive.numbers], [False, True, False, True])
            self.assertEqual(int(drive.truth(3)[0, 0, 0]), 30)
            self.assertEqual(float(drive.visible(0).max()), 0)
            self.assertEqual(float(drive.visible(1).min()), 1)

    def test_a_folder_without_frames_is_refused_with_what_was_expected(self):
        with tempfile.TemporaryDirectory() as root, self.assertRaises(SystemExit) as refused:
            find_drives(root)
        self.assertIn("expected color/, buffer/color/ and buffer/visible/", str(refused.exception))

    def test_blocks_are_filled_by_repeating_the_last_column_and_row(self):
        picture = torch.arange(6.0).reshape(1, 2, 3)
        filled = fill_blocks(picture, 4)
        self.assertEqual(tuple(filled.shape), (1, 4, 4))
        self.assertEqual(filled[0, 3].tolist(), [3, 4, 5, 5])
        self.assertTrue(torch.equal(fill_blocks(filled, 4), filled))

    def test_pixels_survive_the_way_to_floats_and_back(self):
        pixels = torch.arange(256).to(torch.uint8)
        self.assertTrue(torch.equal(to_pixels(to_floats(pixels)), pixels))
        self.assertEqual(to_pixels(torch.tensor([-7.0, 7.0])).tolist(), [0, 255])

    def test_psnr_of_an_error_of_one_everywhere(self):
        pixels = torch.full((3, 4, 4), 100, dtype=torch.uint8)
        self.assertAlmostEqual(psnr(pixels, pixels + 1), 48.1308, places=3)

    def test_a_drive_has_the_frames_asked_for_and_stays_in_its_street(self):
        for seed in range(2000, 2060):
            for length in (40, 60, 200):
                where = drive_of(seed, 8, length)
                frames = length - where["end-margin"] - where["first"] + 1
                self.assertEqual(frames, 4 if where["shift"] else 8)
                self.assertTrue(8 <= where["first"] and where["end-margin"] >= 8)


if __name__ == "__main__":
    unittest.main()

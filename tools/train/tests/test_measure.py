# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Pieces of held-back streets, generated in the engine with several settings and measured against the truth."""
import contextlib
import io
import math
import os
import tempfile
import unittest

import numpy as np

from semtrain import cuts, measure, measure_generated, safetensors_file
from semtrain.json_file import read_json
from semtrain.program import REPOSITORY
from test_transformer import train, write_street


def cells_of(path):
    return safetensors_file.read(path)["cells"].numpy()


class Pieces(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.street = self.path("streets", "7", "truth.sgrid")
        os.makedirs(os.path.dirname(self.street))
        write_street(self.street)
        self.addCleanup(self.folder.cleanup)

    def path(self, *names):
        return os.path.join(self.folder.name, *names)

    def test_hold_the_cells_whose_centres_lie_between_the_bounds(self):
        # voxels of 0.6 m have their centres at 0.3, 0.9, 1.5, ...
        self.assertEqual(cuts.cut_grid(self.street, self.path("pieces"), (0.85, 2.05), (-math.inf, 1.2)), 4)
        for kind in ("truth", "semantic"):
            cells = cells_of(self.path("pieces", kind, "7.sgrid"))
            self.assertEqual(cells.tolist(), [[1, 0, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0]])
        truth, whole = (safetensors_file.read(p) for p in (self.path("pieces", "truth", "7.sgrid"), self.street))
        at = [np.flatnonzero((whole["cells"].numpy() == c).all(1))[0] for c in truth["cells"].numpy()]
        np.testing.assert_array_equal(truth["points"].numpy(), whole["points"].numpy()[at])
        self.assertNotIn("points", safetensors_file.read(self.path("pieces", "semantic", "7.sgrid")))

    def measure(self):
        with contextlib.redirect_stdout(io.StringIO()):
            measure.main([self.path("pieces"), "-o", self.path("table"), "--model",
                          "tiny=" + self.path("run", "model"), "--steps", "2", "3", "--guidance", "1"])
        with open(self.path("table", "table.md")) as file:
            return file.read().splitlines()

    def test_are_generated_with_every_setting_and_measured_once(self):
        train(self.street, self.path("run"), 2)
        cuts.cut_grid(self.street, self.path("pieces"), (0, 2.4), (0, 4.2))
        head, _, *rows = self.measure()
        self.assertEqual([row.split(" | ")[:4] for row in rows],
                         [["| tiny", "ddpm", "2", "1"], ["| tiny", "ddpm", "3", "1"]])
        self.assertEqual(len(rows[0].split("|")), len(head.split("|")))
        result = read_json(self.path("table", "tiny-ddpm-2-1.json"))
        self.assertEqual(result["scores"]["all"]["cells"], len(cells_of(self.path("pieces", "truth", "7.sgrid"))))
        made = os.stat(self.path("table", "tiny-ddpm-2-1", "7.sgrid")).st_mtime_ns
        self.assertEqual(self.measure()[2:], rows)
        self.assertEqual(os.stat(self.path("table", "tiny-ddpm-2-1", "7.sgrid")).st_mtime_ns, made)
        train(self.street, self.path("run"), 4)  # another model of the same name
        with self.assertRaisesRegex(SystemExit, "table was made with model tiny .*, now it is"):
            self.measure()


class GeneratedStreets(unittest.TestCase):
    def test_are_refined_and_compared_with_refined_true_points(self):
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
            measure_generated.main(["-o", folder, "--model", "default=" + os.path.join(REPOSITORY, "assets", "model"),
                                    "--seeds", "9004", "--frames", "2", "--reach", "6", "-W", "128", "-H", "96",
                                    "--objects", "street"])
            with open(os.path.join(folder, "table.md")) as file:
                rows = [line.split(" | ") for line in file.read().splitlines()[2:]]
            self.assertEqual([row[:4] for row in rows][0], ["| default", "true points", "-", "-"])
            self.assertEqual(rows[1][1], "street")
            self.assertGreater(float(rows[1][2]), 10)  # dB: the same place, but not the same points
            self.assertLess(float(rows[1][3]), 1)
            sizes = {name: safetensors_file.read(os.path.join(folder, "streets", "9004", name + ".sgrid"))["cells"].shape
                     for name in ("truth", "semantic")}
            self.assertEqual(sizes["truth"], sizes["semantic"])


if __name__ == "__main__":
    unittest.main()

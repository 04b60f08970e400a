# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""tools/gpu on whatever device is here, with little to do: so that nothing is wrong on the day when a GPU is at hand."""
import json
import os
import stat
import subprocess
import tempfile
import unittest

from semtrain import safetensors_file
from semtrain.program import REPOSITORY, semrover_path

TOOLS = os.path.join(REPOSITORY, "tools", "gpu")
PYTHON = os.environ.get("PYTHON", "/usr/bin/python3")


class OnAMachine(unittest.TestCase):
    def setUp(self):
        self.holder = tempfile.TemporaryDirectory()

    def tearDown(self):
        self.holder.cleanup()

    def path(self, *parts):
        return os.path.join(self.holder.name, *parts)

    def write(self, name, text):
        os.makedirs(os.path.dirname(self.path(name)), exist_ok=True)
        with open(self.path(name), "w") as file:
            file.write(text)
        return self.path(name)

    def program(self, name, text):
        os.chmod(self.write(name, "#!/bin/sh\n" + text), stat.S_IRWXU)
        return self.path(name)

    def run_tool(self, name, *arguments, **environment):
        """-> exit code, what it printed"""
        build = os.path.dirname(os.path.realpath(semrover_path()))
        done = subprocess.run([os.path.join(TOOLS, name), *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              text=True, env={**os.environ, "PYTHON": PYTHON, "BUILD": build, "WORK": self.path("work"),
                                              **environment})
        return done.returncode, done.stdout


class Check(OnAMachine):
    def build_with(self, *tests):
        """a build whose tests are these commands, by name"""
        os.makedirs(self.path("build"))
        self.program("build/semrover", f'exec "{semrover_path()}" "$@"\n')
        self.write("build/CTestTestfile.cmake", "".join(
            f'add_test({name} "{command}")\nset_tests_properties({name} PROPERTIES LABELS device)\n'
            for name, command in tests))
        return self.path("build")

    def test_runs_tests_as_they_are_and_in_their_variants(self):
        code, out = self.run_tool("check", self.path("out"), "^kernel_activation")
        self.assertEqual(code, 0, out)
        for part in ("plain", "simt", "limits"):
            self.assertRegex(out, f"{part}: 1 passed, 0 failed, [0-9.]+ s\n")
            self.assertTrue(os.path.exists(self.path("out", f"{part}.xml")))
        with open(self.path("out", "summary.txt")) as file:
            self.assertEqual(file.read(), out)

    def test_names_what_fails_and_what_had_no_time(self):
        build = self.build_with(("kernel_good", "true"), ("kernel_bad", "false"), ("kernel_bad_simt", "false"))
        code, out = self.run_tool("check", self.path("out"), BUILD=build)
        self.assertEqual(code, 1)
        self.assertRegex(out, r"plain: 1 passed, 1 failed, [0-9.]+ s\n    kernel_bad \.*\*+Failed")
        self.assertIn("simt: 0 passed, 1 failed", out)
        self.assertIn("limits: 0 passed, 0 failed, as there are none", out)
        code, out = self.run_tool("check", self.path("out"), BUILD=build, MINUTES="0")
        self.assertIn("plain: no time was left", out)
        self.assertEqual(code, 1)

    def test_says_what_is_missing(self):
        for environment, line in (({"BUILD": self.path("none")}, "no .*/none/semrover: build it here, or unpack"),
                                  ({"VK_LAYER_PATH": self.path("none")}, "no test can run with validation on"),
                                  ({"VK_ICD_FILENAMES": "none", "VK_DRIVER_FILES": "none"}, "no Vulkan device")):
            code, out = self.run_tool("check", self.path("out"), "^kernel_activation", **environment)
            self.assertEqual(code, 1)
            self.assertRegex(out, f"check: {line}")


class Tiles(OnAMachine):
    def test_makes_profiles_and_says_that_a_device_has_no_matrix_units(self):
        code, out = self.run_tool("tiles", self.path("out"), DIVIDE="64")
        self.assertEqual(code, 1, out)
        for network in ("unet", "vae", "transformer"):
            self.assertRegex(out, f'{network}: "ms_median":[0-9.e+-]+ "gflops":[0-9.e+-]+\n')
            self.assertGreater(os.path.getsize(self.path("out", f"{network}.trace.json.gz")), 0)
        with open(self.path("out", "networks.jsonl")) as file:
            self.assertEqual([json.loads(line)["kind"] for line in file], ["unet", "vae", "transformer"])
        self.assertRegex(out, r"\n[^\n]*: tiles are of matrix units \(VK_KHR_cooperative_matrix\), which it has not\n"
                              "tiles with other bits: 0\nfailed 1\n$")
        self.assertEqual(os.path.getsize(self.path("out", "tiles.jsonl")), 0)
        self.assertLessEqual(len(os.listdir(self.path("out"))), 7)  # the eighth would be NVIDIA's clocks.csv
        with open(self.path("out", "summary.txt")) as file:
            self.assertEqual(file.read(), out)

    def test_names_networks_that_had_no_time(self):
        _, out = self.run_tool("tiles", self.path("out"), DIVIDE="64", MINUTES="0")
        self.assertIn("unet: no time was left\nvae: no time was left\ntransformer: no time was left\n", out)


class Train(OnAMachine):
    SMALL = ["--set", "batch=1", "--set", "set_size=[12,16]"]
    TIMES = {"MINUTES": "0.5", "PROBE": "2", "TABLE_SECONDS": "12", "BATCHES": "2", "LENGTH": "30", "SEEDS": "2000:2000",
             "HELD_SEEDS": "9000:9000"}

    def test_leaves_weights_a_curve_and_a_table_and_the_next_call_goes_on(self):
        code, out = self.run_tool("train", self.path("first"), *self.SMALL, **self.TIMES)
        self.assertEqual(code, 0, out)
        code, out = self.run_tool("train", self.path("second"), "--from", self.path("first"), "--grids",
                                  self.path("work/streets"), "--held", self.path("work/held"), *self.SMALL,
                                  "--set", "batch=2", **{**self.TIMES, "MINUTES": "0.4", "PROCESSES": "2"})
        self.assertEqual(code, 0, out)
        self.assertIn("processes: 2", out)
        files = [os.path.join(folder, name) for folder, _, names in os.walk(self.path("second")) for name in names]
        self.assertLessEqual({os.path.relpath(f, self.path("second")) for f in files}, {
            "model/model_index.json", "model/voxfield_transformer/config.json", "curve.png", "log.jsonl",
            "model/voxfield_transformer/diffusion_pytorch_model.safetensors", "summary.txt", "table.md",
            "model/voxfield_scheduler/scheduler_config.json"})
        self.assertTrue(all(os.path.getsize(f) <= 16 << 20 for f in files))
        first, second = (safetensors_file.read(
            self.path(call, "model/voxfield_transformer/diffusion_pytorch_model.safetensors"))
            for call in ("first", "second"))
        moved = [float((second[name].float() - t.float()).abs().max()) for name, t in first.items()]
        self.assertTrue(0 < max(moved) < 0.1, max(moved))  # it went on from there
        with open(self.path("second", "table.md")) as file:
            rows = [line.split("|")[1].strip() for line in file]
        self.assertEqual(rows, ["model", "---", "teacher, one pass", "before", "now"])

    def test_says_what_is_missing(self):
        for arguments, environment, line in (
                ([], {"PYTHON": self.program("without", "exit 1\n")}, ".*without has no torch, numpy and scipy"),
                ([], {"PYTHON": self.path("none")}, "needs .*/none: install Python 3"),
                ([], {"BUILD": self.path("none")}, "no .*/none/semrover: build it here, or unpack"),
                (["--grids", "x"], {}, "--grids and --held come together"),
                (["--from", "x"], {}, "--from x: no model/voxfield_transformer in it")):
            code, out = self.run_tool("train", self.path("out"), *arguments, **environment)
            self.assertEqual(code, 1, out)
            self.assertRegex(out, f"train: {line}")


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env python3
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A GPU that fails at the n-th call of a kind (tests/vendors/failing_gpu.cpp), for commands and for a host in C: each
failure ends with a status and a line that names what failed, and a run without it in the same folder has the same bytes;
a device that is lost is made anew, to the same bytes.

A spread of FAULTS (24) failures over the kinds of all cases; FAULTS=all: every one. FAULTS_CASE and FAULTS_CALL
choose cases and kinds.
SEMROVER, GPU_HOST, RENDERER and LAYERS: the programs, a model of a renderer, and where the layer's manifest is."""
import collections
import hashlib
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

SOURCES = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCES / "tests/slurm"))
from small_job import write_labels  # noqa: E402

SEMROVER, HOST, RENDERER = os.environ["SEMROVER"], os.environ["GPU_HOST"], os.environ["RENDERER"]
MODEL = str(SOURCES / "tests/golden/sampling_ddpm/model")
MOST_SECONDS = 120  # of a run that takes two: a machine may be busy
COLD_SECONDS = 600  # of one that compiles

HOST_MEMORY, DEVICE_MEMORY, INITIALIZATION, LOST, MAPPING, TOO_MANY, TIMEOUT = -1, -2, -3, -4, -5, -10, 2
RESULTS = collections.defaultdict(lambda: [DEVICE_MEMORY], {
    "vkCreateInstance": [HOST_MEMORY, INITIALIZATION],
    "vkEnumeratePhysicalDevices": [HOST_MEMORY, INITIALIZATION],
    "vkEnumerateDeviceExtensionProperties": [HOST_MEMORY],
    "vkCreateDevice": [DEVICE_MEMORY, INITIALIZATION, TOO_MANY, LOST],
    "vkAllocateMemory": [DEVICE_MEMORY, HOST_MEMORY],
    "vkMapMemory": [MAPPING, HOST_MEMORY],
    "vkQueueSubmit": [LOST, DEVICE_MEMORY, HOST_MEMORY],
    "vkWaitSemaphores": [LOST, TIMEOUT, HOST_MEMORY],
    "vkGetQueryPoolResults": [LOST, DEVICE_MEMORY],
    "vkGetSemaphoreCounterValue": [LOST, HOST_MEMORY],
    "vkCreatePipelineCache": [HOST_MEMORY],
    "vkGetPipelineCacheData": [HOST_MEMORY],
})
NAMES_IT = re.compile(r"vk[A-Z]\w+|the device refused \d+ bytes|no Vulkan driver: VK_\w+|did not finish a submit")
# where the driver has no memory for the list of extensions, it is as if we had none
NAMES = collections.defaultdict(lambda: NAMES_IT, {
    "vkEnumerateDeviceExtensionProperties": re.compile(NAMES_IT.pattern + "|memory is exhausted|no host memory")})


def digest(folder, *patterns):
    files = sorted(path for pattern in patterns for path in folder.glob(pattern))
    return [(path.name, hashlib.sha256(path.read_bytes()).hexdigest()) for path in files]


class Command:
    """of the program; its results are files"""

    def __init__(self, name, arguments, *results, **environment):
        self.name, self.arguments, self.results, self.environment = name, arguments, results, environment

    def run(self, folder, seconds=MOST_SECONDS, **faults):
        arguments = [str(word).replace("OUT", str(folder)) for word in self.arguments]
        return run([SEMROVER, *arguments, "--quiet"], seconds, **self.environment, **faults)

    def made(self, folder, _):
        return digest(folder, *self.results)

    def check(self, test, done, folder, expected, names):
        """what became of a failure, whose line `names` what failed"""
        if done.returncode == 0:
            test.assertEqual(self.made(folder, done), expected)
            return "harmless"
        test.assertIn(done.returncode, (4, 5, 6), done.stderr)
        test.assertRegex(done.stderr, r"\Asemrover: error: [^\n]+\n\Z")
        test.assertRegex(done.stderr, names)
        again = self.run(folder)
        test.assertEqual(again.returncode, 0, again.stderr)
        test.assertEqual(self.made(folder, again), expected)
        return "a status"


class Host(Command):
    """in C; its results are hashes of what it drew"""

    def run(self, folder, seconds=MOST_SECONDS, **faults):
        return run(self.arguments, seconds, **self.environment, **faults)

    def made(self, _, done):
        return done.stdout.splitlines()[-1:]

    def check(self, test, done, folder, expected, names):
        test.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        test.assertEqual(self.made(folder, done), expected, done.stdout)
        failures = done.stdout.splitlines()[:-1]
        for line in failures:
            test.assertRegex(line, r": SR_ERR_(OUT_OF_MEMORY|NO_DEVICE|DEVICE_LOST): .")
            test.assertRegex(line, names)
        return "made anew" if any("DEVICE_LOST" in line for line in failures) else \
            "a status" if failures else "harmless"


def run(words, seconds=COLD_SECONDS, **environment):
    return subprocess.run(words, env={**os.environ, **environment}, capture_output=True, text=True,
                          timeout=seconds)


def spread(groups, count):
    """of each group as many; where there are more groups than that, one of some of them"""
    def some(things, most, shift=0.5):
        return [things[int((i + shift) * len(things) / most)] for i in range(most)] if most < len(things) else things
    each = max(count // len(groups), 1)
    return [fault for i, group in enumerate(some(groups, count)) for fault in some(group, each, i * 0.618 % 1)]


class FailingGpu(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="semrover-faults-")
        cls.addClassCleanup(cls.scratch.cleanup)
        folder = cls.folder = pathlib.Path(cls.scratch.name)
        # without Mesa's layer that chooses devices: it crashes where a call of its own fails
        os.environ.update(VK_ADD_LAYER_PATH=os.environ["LAYERS"], NODEVICE_SELECT="1",
                          VK_INSTANCE_LAYERS="VK_LAYER_SEMROVER_failing_gpu")
        write_labels(folder / "in.sgrid", wall=2, length=6)
        (folder / "ahead.tum").write_text("".join(f"{t} {t} 1.5 1.6 -0.5 0.5 -0.5 0.5\n" for t in (0, 1)))
        generate = ["generate", folder / "in.sgrid", "-m", MODEL, "--steps", "2", "--region-size", "24", "-o"]
        filled = run([SEMROVER, *map(str, generate), str(folder / "filled.sgrid"), "--quiet"])
        assert filled.returncode == 0, filled.stderr
        drive = [folder / "filled.sgrid", "--path", folder / "ahead.tum", "-W", "56", "-H", "40", "-o", "OUT/out"]
        cls.cases = [
            Command("generate", [*generate, "OUT/out.sgrid"], "out.sgrid"),
            Command("generate, timed", [*generate, "OUT/out.sgrid"], "out.sgrid", SEMROVER_LIMITS="submit=0.00001"),
            Command("render", ["render", *drive], "out/*/*.png"),
            Command("refine", ["refine", *drive, "-m", RENDERER, "--steps", "2"], "out/frames/*", "out/latents/*"),
            Host("world", [HOST, MODEL]),
            Host("chain", [HOST, MODEL, RENDERER]),
        ]

    def faults(self, case):
        """every failure of a case, by kind, and what the case makes without one"""
        for attempt in ("cold", "warm"):
            folder = self.folder / f"{case.name}.{attempt}"
            folder.mkdir()
            log = folder / "calls"
            done = case.run(folder, COLD_SECONDS, FAILING_GPU_LOG=str(log))
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        counts = [line.split() for line in log.read_text().splitlines()]
        wanted = os.environ.get("FAULTS_CALL", "")
        return [[(case, case.made(folder, done), name, result, n) for n in range(1, int(count) + 1)]
                for name, count in counts if wanted in name for result in RESULTS[name]]

    def fail_at(self, number, case, expected, name, result, n):
        folder = self.folder / f"{case.name}.{number}"
        folder.mkdir()
        log = folder / "failures"
        with self.subTest(case=case.name, call=name, result=result, n=n):
            outcome = "WRONG"
            try:
                done = case.run(folder, FAILING_GPU_CALL=name, FAILING_GPU_AT=str(n), FAILING_GPU_RESULT=str(result),
                                FAILING_GPU_LOG=str(log))
                outcome = case.check(self, done, folder, expected, NAMES[name])
                if "failed" not in log.read_text():
                    outcome = "not reached"
                elif outcome == "harmless" and result in (LOST, TIMEOUT):
                    outcome = "made anew"
            finally:
                self.table[case.name, name][outcome] += 1

    def test_every_failure_ends_well(self):
        wanted, count = os.environ.get("FAULTS_CASE", ""), os.environ.get("FAULTS", "24")
        self.table = collections.defaultdict(collections.Counter)
        groups = [group for case in self.cases if wanted in ("", case.name) for group in self.faults(case)]
        every = sum(groups, [])
        chosen = every if count == "all" else spread(groups, int(count))
        for number, fault in enumerate(chosen):
            self.fail_at(number, *fault)
        print(f"{len(chosen)} of {len(every)} failures", file=sys.stderr)
        for (case, name), outcomes in self.table.items():
            print(f"{case}: {name}: " + ", ".join(f"{count} {what}" for what, count in outcomes.items()),
                  file=sys.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What is built for Windows, under Wine, beside the same of this machine, on the same driver: test_windows.py
LINUX_BUILD WINDOWS_BUILD [--library]. With --library nothing of the programs."""
import importlib
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import types
import unittest

SOURCES = pathlib.Path(__file__).resolve().parents[2]
LINUX, WINDOWS = (pathlib.Path(p).resolve() for p in sys.argv[1:3])
LIBRARY_ONLY = "--library" in sys.argv[3:]
os.environ["LC_ALL"] = "C.UTF-8"  # else Wine takes what it is called with for Latin-1
os.environ["SEMROVER"] = "unused"  # by the class below, which runs other programs here
sys.path[:0] = [str(SOURCES / "tests/abi"), str(SOURCES / "tests/slurm")]
import structures  # noqa: E402
from small_job import SmallJob, write_labels  # noqa: E402

MODEL = SOURCES / "tests/golden/sampling_ddpm/model"
WINE = "/usr/lib/wine/wine64"
MINGW = "x86_64-w64-mingw32-"
FOLDER = "Größe 東京 & mit Leerzeichen"
# of Windows itself, and of the driver
DLLS = {"kernel32.dll", "msvcrt.dll", "vulkan-1.dll"}


def run(line, **options):
    return subprocess.run([str(word) for word in line], capture_output=True, timeout=300, **options)


def run_well(line, **options):
    done = run(line, **options)
    if done.returncode != 0:
        raise AssertionError(f"{line}: {done.returncode}\n{done.stdout.decode()}\n{done.stderr.decode()}")
    return done.stdout.decode()


def on_windows(*words, **options):
    """a program of the build for Windows, which begins on drive Z:"""
    return run([WINE, WINDOWS / words[0], *words[1:]], **options)


class WithFolder(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="semrover-windows-"))
        self.addCleanup(shutil.rmtree, self.folder, True)

    def expect_same(self, one, other):
        self.assertGreater(one.stat().st_size, 0)
        self.assertTrue(one.read_bytes() == other.read_bytes(), f"{one} and {other} differ")


class Library(WithFolder):
    def test_it_shows_what_the_one_of_linux_shows(self):
        dump = run_well([MINGW + "objdump", "-p", WINDOWS / "semrover.dll"])
        shown = set(re.findall(r"^\t\[ *\d+\] (\w+)$", dump, re.M))
        expected = {line.split()[-1].split("@")[0]
                    for line in run_well(["nm", "-D", "--defined-only", LINUX / "libsemrover.so"]).splitlines()}
        self.assertEqual(shown, expected - {"SEMROVER_0"})

    def test_it_needs_nothing_that_a_game_would_have_to_bring(self):
        dump = run_well([MINGW + "objdump", "-p", WINDOWS / "semrover.dll"])
        self.assertLessEqual({name.lower() for name in re.findall(r"DLL Name: (\S+)", dump)}, DLLS)

    def test_structures_are_those_of_linux(self):
        package = types.ModuleType("package")  # without what its __init__ imports
        package.__path__ = [str(SOURCES / "tools/python/semrover")]
        sys.modules["package"] = package
        abi = importlib.import_module("package._abi")
        source = self.folder / "sizes.c"
        source.write_text(structures.checks(abi))
        run_well([MINGW + "gcc-posix", "-std=c11", "-I", SOURCES / "engine", "-c", source, "-o",
                  self.folder / "sizes.o"])

    def test_the_example_draws_the_same_picture(self):
        scene = SOURCES / "assets/scenes/street.semantic.sgrid"
        windows, linux = self.folder / "windows.ppm", self.folder / "linux.ppm"
        done = on_windows("library_example.exe", MODEL, scene, windows)
        self.assertEqual(done.returncode, 0, done.stderr.decode())
        run_well([LINUX / "tests/library_example", MODEL, scene, linux])
        self.expect_same(windows, linux)

    def test_the_sample_host_finds_it_installed_and_draws_the_same(self):
        pictures = {}
        for system, build in (("linux", LINUX), ("windows", WINDOWS)):
            folder = self.folder / system
            toolchain = ["--toolchain", SOURCES / "cmake/windows/toolchain.cmake"] if system == "windows" else []
            run_well(["cmake", "--install", build, "--prefix", folder / "prefix", "--component", "library"])
            run_well(["cmake", "-S", folder / "prefix/share/semrover/host", "-B", folder / "build", "-G", "Ninja",
                      *toolchain, f"-DCMAKE_PREFIX_PATH={folder / 'prefix'}"])
            run_well(["cmake", "--build", folder / "build", "--target", "record_host"])
            (folder / "frames").mkdir()
            host = folder / "build/record_host"
            if system == "windows":
                shutil.copy(folder / "prefix/bin/semrover.dll", folder / "build")
                run_well([WINE, f"{host}.exe", MODEL, folder / "frames", 2])
            else:
                run_well([host, MODEL, folder / "frames", 2])
            pictures[system] = sorted((folder / "frames").iterdir())
        self.assertEqual(len(pictures["linux"]), 2)
        for one, other in zip(pictures["windows"], pictures["linux"], strict=True):
            self.expect_same(one, other)


@unittest.skipIf(LIBRARY_ONLY, "of the library only")
class Programs(WithFolder):
    def setUp(self):
        super().setUp()
        self.folder /= FOLDER
        self.folder.mkdir()

    def generate(self, output, *more):
        return ["--quiet", "generate", self.folder / "in.sgrid", "-m", MODEL, "-o", output, "--steps", 4, "--seed", 7,
                "--region-size", 24, "--coverage-threshold", 6, *more]

    def test_a_street_its_pictures_and_its_frames_are_those_of_linux(self):
        write_labels(self.folder / "in.sgrid", 2, 24)
        (self.folder / "ahead.tum").write_text("".join(
            f"{x} {x} 1.8 1.6 -0.5 0.5 -0.5 0.5\n" for x in (0.2, 0.8, 1.4)))
        folders = {}
        for system in ("linux", "windows"):
            out = folders[system] = self.folder / system
            out.mkdir()
            start = [LINUX / "semrover"] if system == "linux" else [WINE, WINDOWS / "semrover.exe"]
            run_well([*start, *self.generate(out / "out.sgrid")])
            run_well([*start, "--quiet", "render", out / "out.sgrid", "-o", out / "frames", "--path",
                      self.folder / "ahead.tum", "--width", 56, "--height", 40])
            run_well([*start, "--quiet", "refine", out / "frames", "-o", out / "refined", "-m",
                      WINDOWS / "tests/capi_renderer", "--steps", 2])
        names = [sorted(p.relative_to(folder) for p in folder.rglob("*.*") if p.suffix in (".sgrid", ".png"))
                 for folder in folders.values()]
        self.assertEqual(names[0], names[1])
        self.assertGreater(len(names[0]), 12)
        for name in names[0]:
            self.expect_same(folders["windows"] / name, folders["linux"] / name)

    def test_a_job_publishes_what_it_publishes_on_linux(self):
        jobs = SmallJob(self.folder / "job", scenes=2)
        for system, start in (("linux", [LINUX / "semrover"]), ("windows", [WINE, WINDOWS / "semrover.exe"])):
            run_well([*start, "--device", 0, "--require", "any", "--quiet", "run", jobs.file, "-o",
                      jobs.folder / system])
        self.assertEqual(jobs.published("windows"), jobs.published("linux"))
        self.assertEqual(jobs.attempts("windows"), [])

    def test_a_killed_process_is_resumed(self):
        write_labels(self.folder / "in.sgrid", 2, 60)
        whole, cut = self.folder / "whole.sgrid", self.folder / "cut.sgrid"
        self.assertEqual(on_windows("semrover.exe", *self.generate(whole)).returncode, 0)
        journal = self.folder / "cut.sgrid.run/journal.jsonl"
        kills = 0
        while kills < 3:
            lines = len(journal.read_text().splitlines()) if journal.exists() else 0
            child = subprocess.Popen([str(w) for w in (WINE, WINDOWS / "semrover.exe",
                                                       *self.generate(cut, "--batch", 1))],
                                     stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            while child.poll() is None and (not journal.exists() or len(journal.read_text().splitlines()) <= lines):
                time.sleep(0.001)
            child.send_signal(signal.SIGKILL)
            if child.wait() == 0:
                break
            kills += 1
        self.assertGreater(kills, 0)
        done = on_windows("semrover.exe", *self.generate(cut, "--batch", 1))
        self.assertEqual(done.returncode, 0, done.stderr.decode())
        self.expect_same(cut, whole)
        self.assertEqual(list(self.folder.glob("*.tmp")) + list(self.folder.glob(".semrover*")), [])

    def test_two_processes_do_not_share_a_run(self):
        write_labels(self.folder / "in.sgrid", 2, 60)
        out = self.folder / "out.sgrid"
        line = [str(w) for w in (WINE, WINDOWS / "semrover.exe", *self.generate(out, "--batch", 1))]
        first = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while first.poll() is None and not (self.folder / "out.sgrid.run/journal.jsonl").exists():
            time.sleep(0.001)
        second = run(line)
        self.assertEqual(first.wait(), 0)
        self.assertIn(b"another process works in", second.stderr)
        self.assertEqual(second.returncode, 75)

    @unittest.skipIf(os.geteuid() != 0, "a small disk is mounted as root")
    def test_a_full_disk_leaves_nothing_half_written(self):
        write_labels(self.folder / "in.sgrid", 2, 60)
        disk = self.folder / "disk"
        disk.mkdir()
        run_well(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk])
        self.addCleanup(run_well, ["umount", disk])
        full = on_windows("semrover.exe", *self.generate(disk / "out.sgrid"))
        self.assertEqual(full.returncode, 3, full.stderr.decode())
        self.assertIn(b"o space left", full.stderr)
        self.assertFalse((disk / "out.sgrid").exists())
        run_well(["mount", "-o", "remount,size=64m", disk])
        self.assertEqual(on_windows("semrover.exe", *self.generate(disk / "out.sgrid")).returncode, 0)
        whole = self.folder / "whole.sgrid"
        run_well([LINUX / "semrover", *self.generate(whole)])
        self.expect_same(disk / "out.sgrid", whole)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + [w for w in sys.argv[3:] if w != "--library"], verbosity=2)

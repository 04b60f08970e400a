# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A job on a file system that hides new names, has no locks, loses answers and is full: tests/faults/faulty_files.c."""
import errno
import os
import pathlib
import random
import tempfile
import time
import unittest

from small_job import SmallJob

LIBRARY = os.environ["FAULTY_FILES"]


class LyingFiles(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="semrover-lying-")
        cls.addClassCleanup(cls.folder.cleanup)
        cls.job = SmallJob(cls.folder.name + "/job", scenes=2)
        honest = cls.job.run(out="honest")
        assert honest.returncode == 0, honest.stderr
        cls.honest = cls.job.published("honest")

    def lied_to(self, *options, **lies):
        return self.job.run(*options, out=self.id(), LD_PRELOAD=LIBRARY, FAULT_FOLDER=str(self.job.folder), **lies)

    def expect_whole(self):
        self.assertEqual(self.job.published(self.id()), self.honest)
        self.assertGreater(len(self.honest), 2 * 3 * 4)

    def test_a_scene_that_is_not_seen_yet_is_waited_for(self):
        self.assertEqual(self.job.run("--stage", "scene", out=self.id()).returncode, 0)
        hide = f"{self.job.folder / self.id()}/scenes:5"
        early = self.lied_to("--stage", "drive", "--wait", "0", FAULT_HIDE=hide)
        self.assertEqual(early.returncode, 75, early.stderr)
        begin = time.monotonic()
        late = self.lied_to("--stage", "drive", FAULT_HIDE=hide)
        self.assertEqual(late.returncode, 0, late.stderr)
        self.assertGreater(time.monotonic() - begin, 1)
        self.expect_whole()

    def test_without_locks_it_goes_on_and_says_so(self):
        done = self.lied_to(FAULT=f"lock:1+:{errno.ENOSYS}")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr.count("without locks"), 1, done.stderr)
        self.expect_whole()

    def test_a_rename_that_worked_and_failed(self):
        """of every folder, each of which is sealed and published, and of some files"""
        log = pathlib.Path(self.folder.name) / "log"
        for kind, k in [("move", k) for k in range(1, 9)] + [("rename", k) for k in (1, 2, 17, 35, 50, 70)]:
            with self.subTest(kind=kind, k=k):
                out = f"{self.id()}.{kind}.{k}"
                lies = {"FAULT_FOLDER": str(self.job.folder), "FAULT": f"{kind}:{k}:{errno.ENOENT}:after"}
                done = self.job.run(out=out, LD_PRELOAD=LIBRARY, FAULT_LOG=str(log), **lies)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn(f"FAULT {kind} ", log.read_text())
                log.unlink()
                self.assertEqual(self.job.published(out), self.honest)
                self.assertEqual(self.job.attempts(out), [])

    def test_a_full_disk_publishes_nothing_that_is_not_whole(self):
        chance = random.Random(3)
        for k in (1, *(chance.randrange(2, 60) for _ in range(5))):
            full = self.lied_to(FAULT=f"write:{k}+:{errno.ENOSPC}")
            self.assertIn(full.returncode, (3, 7), full.stderr)
            self.assertIn("No space left on device", full.stderr)
            for name, value in self.job.published(self.id()).items():
                self.assertEqual(self.honest.get(name), value, f"{name} after write {k}")
        self.assertEqual(self.job.run(out=self.id()).returncode, 0)
        self.expect_whole()


if __name__ == "__main__":
    unittest.main(verbosity=2)

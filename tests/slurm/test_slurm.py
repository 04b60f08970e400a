# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""tools/cluster/slurm on a real Slurm of two nodes: exit codes, equal bytes, kills, a task that runs twice at once."""
import json
import os
import pathlib
import random
import shutil
import signal
import sys
import tempfile
import time
import unittest

import cluster
from small_job import SEMROVER, SOURCES, SmallJob

SEED = 11
SKIPPED = 77  # for ctest

# plays `semrover`: NAME.STAGE.PART holds the codes that the element ends with, one after the other, then 0
FAKE = """\
#!/bin/bash
[ "$3" != --parts ] || exec cat "$2.parts"
element=$2.$6.${4%/*}
echo "${SLURM_RESTART_COUNT:-0} $SLURMD_NODENAME" >> "$element.runs"
code=$(sed -n "$((${SLURM_RESTART_COUNT:-0} + 1))p" "$element" 2>/dev/null)
[ "$code" != slow ] || { trap "exit 130" TERM; sleep 60 & wait; }
exit "${code:-0}"
"""

# plays that each node is a machine of its own
REAL = """\
#!/bin/bash
export SEMROVER_HOST=${SLURMD_NODENAME:-login}
exec "%s" --device 0 --require any --quiet "$@"
"""


class Slurm(unittest.TestCase):
    folder = cluster = None  # of main()

    def tearDown(self):
        self.cluster.call("scancel", "--user=root")
        cluster.wait_until(lambda: not self.cluster.jobs(), 30, "an empty queue")

    def program(self, name, text):
        path = self.folder / name
        path.write_text(text)
        path.chmod(0o755)
        return str(path)

    def submit(self, job, program, **variables):
        """-> the numbers of its arrays: scene 0, drive 0, the other scenes, the other drives"""
        printed = self.cluster.call(str(SOURCES / "tools/cluster/slurm"), str(job), f"--output={self.folder}/%A_%a.out",
                                    SEMROVER=program, **variables)
        return [number for line in printed.splitlines() for number in line.split()]

    def run_out(self, seconds, beside=lambda: None):
        """lets the queue run until it is empty"""

        def step():
            beside()
            self.cluster.hurry()
            self.cluster.ask_nodes()
            return not self.cluster.jobs()

        cluster.wait_until(step, seconds, "an empty queue")

    # ---- exit codes

    def test_codes_that_are_tried_again_and_those_that_are_not(self):
        program, job = self.program("fake", FAKE), self.folder / "codes"
        codes = {"scene.0": [75, 75], "scene.1": [4], "scene.2": [130], "scene.3": [3], "drive.0": [6],
                 "drive.1": [7], "drive.2": [5], "scene.4": [137] * 9, "drive.5": [2]}
        pathlib.Path(f"{job}.parts").write_text("6\n")
        for name, values in codes.items():
            pathlib.Path(f"{job}.{name}").write_text("".join(f"{v}\n" for v in values))
        self.submit(job, program)
        self.run_out(60)
        runs = {f.name.removeprefix("codes.").removesuffix(".runs"): [r.split() for r in f.read_text().splitlines()]
                for f in self.folder.glob("codes.*.runs")}
        self.assertEqual({name: len(r) for name, r in runs.items()},
                         {"scene.0": 3, "scene.1": 2, "scene.2": 2, "scene.3": 1, "scene.4": 4, "scene.5": 1,
                          "drive.0": 2, "drive.1": 1, "drive.2": 1, "drive.5": 1})  # none of scenes 3 and 4
        for moved in ("scene.1", "drive.0"):  # 4 and 6
            self.assertNotEqual(runs[moved][0][1], runs[moved][1][1], moved)

    def test_what_is_cancelled_stays_away_and_what_runs_out_of_time_comes_back(self):
        program, job = self.program("fake", FAKE), self.folder / "time"
        pathlib.Path(f"{job}.parts").write_text("1\n")
        pathlib.Path(f"{job}.scene.0").write_text("slow\n" * 2)
        self.submit(job, program)
        runs = pathlib.Path(f"{job}.scene.0.runs")
        cluster.wait_until(runs.exists, 10, "the element runs")
        number = self.running()
        self.cluster.call("scancel", "--batch", "--signal=USR1", number)
        self.hurry_until(lambda: len(runs.read_text().splitlines()) == 2)
        self.cluster.call("scancel", number)
        cluster.wait_until(lambda: not self.cluster.jobs(), 15, "nothing of it left")

    def test_a_node_without_a_device_is_left_out(self):
        job = SmallJob(self.folder / "nowhere", scenes=1)
        first = self.submit(job.file, self.program("real", REAL % SEMROVER), VK_DRIVER_FILES="/nonexistent",
                            VK_ICD_FILENAMES="/nonexistent")[0] + "_0"
        cluster.wait_until(lambda: self.cluster.field(first, "ExcNodeList") in cluster.NODES, 20, "a node excluded")
        cluster.wait_until(lambda: self.cluster.field(first, "JobState") == "PENDING", 20, "it waits once more")
        self.assertIn("no Vulkan", (self.folder / f"{first}.out").read_text())

    def running(self):
        return next(number for number, state, _ in self.cluster.jobs() if state == "RUNNING")

    def hurry_until(self, condition):
        cluster.wait_until(lambda: self.cluster.hurry() or condition(), 40, "what was waited for")

    # ---- bytes

    def test_kills_do_not_change_a_byte(self):
        job = SmallJob(self.folder / "job", scenes=6, steps=30)
        whole = job.run(out="whole")
        self.assertEqual(whole.returncode, 0, whole.stderr)
        expected = job.published("whole")
        self.assertEqual(len(expected), 6 * (1 + 1) + 6 * (5 + 3 * 5))  # four files a drive, a manifest
        for parts in (3, 7):
            for part in range(parts):
                done = job.run("--part", f"{part}/{parts}", out=f"in{parts}")
                self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(job.published(f"in{parts}"), expected)
        program = self.program("real", REAL % SEMROVER)
        chance, kills = random.Random(SEED), []
        plan = ["program"] * 12 + ["step"] * 3 + ["node"] * 3 + ["daemon"] * 2
        chance.shuffle(plan)
        at = time.monotonic() + 1

        def kill_one():
            nonlocal at
            if not plan or time.monotonic() < at:
                return
            node = chance.choice(cluster.NODES)
            scripts = self.cluster.scripts(node)
            if not scripts:
                return
            kind = plan.pop()
            kills.append(kind)
            at = time.monotonic() + chance.uniform(0.3, 1.5)
            if kind == "program":
                for pid in cluster.descendants(scripts[0]):
                    cluster.kill(pid, chance.choice((signal.SIGKILL, signal.SIGTERM)))
                return
            getattr(self.cluster, f"kill_{kind}")(node)
            if kind != "step":
                self.cluster.start_node(node)  # the machine is back

        for _ in range(10):  # a user who sees that something failed gives the same command again
            numbers = self.submit(job.file, program)
            self.cluster.call("scontrol", "update", f"JobId={numbers[2]}", "Dependency=")  # no minute for element 0
            self.run_out(120, kill_one)
            if job.published() != expected:
                continue
            if not plan:
                break
            for stage in ("scenes", "drives"):  # a fast machine was done before the last kill: once more
                shutil.rmtree(job.folder / "out" / stage)
        self.assertEqual((len(kills), plan), (20, []))
        self.assertEqual(job.published(), expected)
        self.assertEqual(job.run("--check").returncode, 0)

    def test_a_task_that_runs_twice_at_once_is_published_once(self):
        """A node is out of reach and works on, while Slurm starts its element on the other one."""
        job = SmallJob(self.folder / "twice", scenes=1, steps=60)
        self.assertEqual(job.run(out="whole").returncode, 0)
        self.submit(job.file, self.program("real", REAL % SEMROVER))
        cluster.wait_until(lambda: (job.folder / "out").exists() and job.attempts(), 20, "an attempt")
        lost = self.cluster.field(self.running(), "BatchHost")
        program = cluster.descendants(self.cluster.scripts(lost)[0])[-1]
        os.kill(program, signal.SIGSTOP)  # so that it is the later of the two
        its_own = job.attempts()
        self.cluster.kill_daemon(lost)
        manifest = job.folder / "out/scenes/s0/manifest.json"
        self.hurry_until(manifest.exists)
        self.assertEqual(job.attempts(), its_own)
        os.kill(program, signal.SIGCONT)
        cluster.wait_until(lambda: not cluster.arguments_of(program)[0:1] or not job.attempts(), 30, "its attempt gone")
        self.assertNotEqual(json.loads(manifest.read_text())["host"], lost)
        self.cluster.start_node(lost)
        self.run_out(60)
        self.assertEqual(job.attempts(), [])
        self.assertEqual(job.published(), job.published("whole"))


def main():
    missing = cluster.missing_programs()
    if os.geteuid() != 0 or missing:
        print(f"skipped: {', '.join(missing)} not installed (tools/setup --test)" if missing else
              "skipped: slurmctld and slurmd are started as root")
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="semrover-slurm-") as folder:
        Slurm.folder = pathlib.Path(folder)
        Slurm.cluster = cluster.Cluster(Slurm.folder / "cluster")
        try:
            Slurm.cluster.start()
            return 0 if unittest.main(verbosity=2, exit=False).result.wasSuccessful() else 1
        except (RuntimeError, TimeoutError) as error:  # of start(): those of tests do not get here
            print(f"skipped: a Slurm of two nodes does not start here: {error}")
            return SKIPPED
        finally:
            Slurm.cluster.stop()


if __name__ == "__main__":
    sys.exit(main())

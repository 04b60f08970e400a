# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The power is cut at any moment of a command that goes on from what is there: the same command gives the bytes of an
undisturbed run, or refuses what it finds with a line and takes it with -y. After exit code 0 all is on the disk.

CUTS=K tries K disks of each command, evenly spread, CUTS=all every one; COMMANDS=a,b only these."""
import os
import random
import unittest

from power_cuts import cuts, put, read_record
from small_work import BEGINS_AGAIN, COMMANDS, SmallWorkTest, differences

LIBRARY = os.environ["FAULTY_FILES"]
MOST = os.environ.get("CUTS", "3")
ONLY = os.environ.get("COMMANDS", "generate,generate_along,render,edit,run").split(",")
SEED = 5


class PowerCuts(SmallWorkTest):
    def test_every_command(self):
        print("\ncommand | calls recorded | disks compared of all | same bytes | refused with a line")
        for name in ONLY:
            self.command(name, COMMANDS[name])

    def command(self, name, line):
        self.work.clear()
        self.log.unlink(missing_ok=True)
        done = self.work.run(line, name=name, LD_PRELOAD=LIBRARY, FAULT_RECORD=str(self.log))
        self.assertEqual(done.returncode, 0, f"{name}: {done.stderr}")
        whole, calls = self.work.results(), read_record(self.log)
        prefix = str(self.work.out) + "/"
        calls = [call for call in calls if (call.path + "/").startswith(prefix)]
        disks = list(cuts(calls, self.work.out, random.Random(SEED)))
        step = 1 if MOST == "all" else max(1, len(disks) // int(MOST))
        chosen = disks[step // 2::step]
        came = {"same": 0, "refused": 0}
        for at, which, kept in chosen:
            with self.subTest(command=name, cut=f"after {at} of {len(calls)} calls", which=which):
                came[self.go_on(name, line, whole, kept)] += 1
        with self.subTest(command=name, cut="after the end"):
            for at, which, kept in disks:
                if at == len(calls):
                    self.expect_kept(whole, which, kept)
        print(f"{name} | {len(calls)} | {len(chosen)} of {len(disks)} | {came['same']} | {came['refused']}", flush=True)

    def go_on(self, name, line, whole, kept):
        self.work.clear()
        put(kept, self.work.out)
        again = self.work.run(line, name=name)
        outcome = "same"
        if again.returncode == 2 and not differences(whole, self.work.results()):
            return outcome  # all was done: it says that it is there
        if again.returncode != 0:
            lines = [text for text in again.stderr.splitlines() if not text.startswith("semrover: warning: ")]
            self.assertEqual(len(lines), 2 if again.returncode == 7 else 1, again.stderr)
            self.assertIn(again.returncode, (2, 3, 7), lines[0])
            self.assertTrue(lines[0].startswith("semrover: error: "), lines[0])
            self.assertTrue("-y" in lines[0] and (name in BEGINS_AGAIN or again.returncode == 3), lines[0])
            again = self.work.run(line, ["-y"], name=name)
            outcome = "refused"
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertEqual(differences(whole, self.work.results()), {}, outcome)
        return outcome

    def expect_kept(self, whole, which, kept):
        self.work.clear()
        put(kept, self.work.out)
        self.assertEqual(differences(whole, self.work.results()), {}, which)


if __name__ == "__main__":
    unittest.main(verbosity=2)

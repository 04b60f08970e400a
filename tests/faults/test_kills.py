# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""SIGKILL at random moments of all commands that write: the same command, or with -y, gives the bytes of an undisturbed
run. KILLS=N; COMMANDS=a,b only these; SEED=S."""
import collections
import os
import random
import time
import unittest

from small_work import BEGINS_AGAIN, COMMANDS, SmallWorkTest, differences

KILLS = int(os.environ.get("KILLS", "10"))
USUAL = ",".join(COMMANDS) if KILLS >= len(COMMANDS) else \
    "generate,generate_along,render,edit,inpaint,run,tile,convert_model,pack,unpack"
ONLY = os.environ.get("COMMANDS", USUAL).split(",")


class Kills(SmallWorkTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.whole, cls.seconds = {}, {}

    def undisturbed(self, name):
        if name not in self.whole:
            self.work.clear()
            begin = time.monotonic()
            done = self.work.run(COMMANDS[name], name=name)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.seconds[name] = time.monotonic() - begin
            self.whole[name] = self.work.results()

    def test_every_command(self):
        chance = random.Random(int(os.environ.get("SEED", "8")))
        came = collections.Counter()
        for i in range(KILLS):
            name = ONLY[i % len(ONLY)]
            self.undisturbed(name)
            with self.subTest(command=name, kill=i):
                came[self.kill(name, chance.random() * self.seconds[name])] += 1
        print("\n" + ", ".join(f"{n} {what}" for what, n in came.items()), flush=True)

    def kill(self, name, seconds):
        self.work.clear()
        process = self.work.start(COMMANDS[name], name=name)
        time.sleep(seconds)
        killed = process.poll() is None
        process.kill()
        process.communicate()
        again = self.work.run(COMMANDS[name], name=name)
        outcome = "went on to the same bytes"
        if again.returncode == 2 and not differences(self.whole[name], self.work.results()):
            return "was done"
        if again.returncode == 2 and "-y" in again.stderr:
            outcome = "was refused, and with -y gave the same bytes"
            self.assertTrue(name in BEGINS_AGAIN, f"after {seconds:.3f} s: {again.stderr}")
            again = self.work.run(COMMANDS[name], ["-y"], name=name)
        self.assertEqual(again.returncode, 0, f"after {seconds:.3f} s: {again.stderr}")
        self.assertEqual(differences(self.whole[name], self.work.results()), {}, f"after {seconds:.3f} s")
        return outcome if killed else "had ended before"


if __name__ == "__main__":
    unittest.main(verbosity=2)

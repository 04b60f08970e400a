# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Two processes at the same job (`semrover run`): one stops at its Nth call of a kind, the other works in the meantime,
then the first goes on. Both end with 0, one of them publishes the bytes of an undisturbed run, no attempt stays. And one
is killed at that call: the other goes on to the same bytes.

STOPS=K stops at K calls of each kind, evenly spread, STOPS=all at every one; COMMANDS=a,b only these."""
import collections
import os
import pathlib
import signal
import time
import unittest

from small_work import COMMANDS, SmallWorkTest, differences
from test_faults import spread

LIBRARY = os.environ["FAULTY_FILES"]
MOST = os.environ.get("STOPS", "1")
ONLY = [name for name in os.environ.get("COMMANDS", "").split(",") if name.startswith("run")] or ["run", "run_shards"]
CHANGES = ("rename", "move", "mkdir", "link", "unlink")  # of what the other one sees
LOOKS = ("list", "entry", "open", "link", "create")  # of one that takes over


class TwoAtOnce(SmallWorkTest):
    def start(self, name, **fault):
        return self.work.start(COMMANDS[name], name=name, LD_PRELOAD=LIBRARY, **fault)

    def calls(self, name):
        """-> each call of an undisturbed run, KIND PATH"""
        self.work.clear()
        self.log.unlink(missing_ok=True)
        process = self.start(name, FAULT_LOG=str(self.log))
        text = process.communicate(timeout=120)[1]
        self.assertEqual(process.returncode, 0, text)
        self.whole = self.work.results()
        return self.log.read_text().splitlines()

    def stopped(self, process):
        """waits until it stands still -> whether it does, or has ended"""
        until = time.monotonic() + 120
        while process.poll() is None:
            if pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "T":
                return True
            self.assertLess(time.monotonic(), until, "HANGS")
            time.sleep(0.002)
        return False

    def end(self, process):
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
        text = process.communicate(timeout=120)[1]
        self.assertEqual(process.returncode, 0, text)

    def expect_published_once(self):
        self.assertEqual(differences(self.whole, self.work.results()), {})
        self.assertEqual([p.name for p in (self.work.out / "job/.work").iterdir()], [])

    def one_stops(self, name, kind, call):
        self.work.clear()
        first = self.start(name, FAULT=f"{kind}:{call}:-2")
        stopped = self.stopped(first)
        self.end(self.start(name))
        self.end(first)
        self.expect_published_once()
        return stopped

    def one_is_killed(self, name, kind, call):
        self.work.clear()
        first = self.start(name, FAULT=f"{kind}:{call}:-2")
        stopped = self.stopped(first)
        first.kill()
        first.communicate()
        self.end(self.start(name))
        self.assertEqual(differences(self.whole, self.work.results()), {})
        return stopped

    def one_stops_while_it_takes_over(self, name, kind, call, work):
        """`work`: the call of the other one's at which there is something to take over"""
        self.work.clear()
        first = self.start(name, FAULT="{}:{}:-2".format(*work))
        self.stopped(first)
        second = self.start(name, FAULT=f"{kind}:{call}:-2")
        stopped = self.stopped(second)
        self.end(first)
        self.end(second)
        self.expect_published_once()
        return stopped

    def tried(self, what, name, *words):
        with self.subTest(what.__name__, command=name, words=words):
            try:
                self.stops[what.__name__] += what(name, *words)
            except AssertionError as failure:
                print(what.__name__, name, *words, str(failure).replace("\n", " "), flush=True)
                raise

    def test_every_command(self):
        self.stops = collections.Counter()
        for name in ONLY:
            log = self.calls(name)
            kinds = [entry.split(" ", 1)[0] for entry in log]
            counts = collections.Counter(kinds)
            for kind in CHANGES:
                for call in spread(counts[kind], MOST):
                    self.tried(self.one_stops, name, kind, call)
                    self.tried(self.one_is_killed, name, kind, call)
                print(name, kind, counts[kind], "calls", flush=True)
            journal = [i for i, entry in enumerate(log) if entry.startswith("flush ") and "journal" in entry]
            for at in (journal[0], journal[-1]):
                for kind in LOOKS:
                    for call in spread(counts[kind], MOST):
                        work = "flush", kinds[:at + 1].count("flush")
                        self.tried(self.one_stops_while_it_takes_over, name, kind, call, work)
                    print(name, "takes over at", at, kind, counts[kind], "calls", flush=True)
        print("\n" + ", ".join(f"{what} {n}" for what, n in self.stops.items()), flush=True)
        self.assertEqual(len(self.stops), 3)


if __name__ == "__main__":
    unittest.main(verbosity=2)

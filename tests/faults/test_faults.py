# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The Nth call of each kind fails, for every command that writes: an error is one line that says which file and why,
nothing is half-written, nothing is left, and the same command goes on to the bytes of an undisturbed run.

FAULTS=K tries K of each kind and command, evenly spread, FAULTS=all every one (in CI: of quick commands all that looks);
COMMANDS=a,b only these."""
import collections
import errno
import os
import unittest

from small_work import BEGINS_AGAIN, COMMANDS, SmallWorkTest, differences, essence

LIBRARY = os.environ["FAULTY_FILES"]
MOST = os.environ.get("FAULTS", "1")
ONLY = os.environ.get("COMMANDS", "").split(",")

# a kind's errors; 0: it says that it was done and was not, -1: half of it is
ERRORS = {
    "create": (errno.EACCES, errno.EMFILE), "open": (errno.EIO, errno.EMFILE), "list": (errno.EIO,),
    "entry": (errno.EIO,), "stat": (errno.EACCES,), "read": (errno.EIO, -1), "write": (errno.ENOSPC, errno.EIO, -1),
    "flush": (errno.EIO,), "close": (errno.EIO,), "map": (errno.ENOMEM,), "lock": (errno.ENOLCK,),
    "rename": (errno.EACCES,), "move": (errno.EACCES,), "mkdir": (errno.ENOSPC,), "link": (errno.EMLINK,),
    "unlink": (errno.EACCES,), "cut": (errno.EIO,),
}
CODES = (3, 5, 7)  # bad input, memory; of `run`: a task failed
# in CI: those that a device takes no time for, and of some others what writes
QUICK = ("edit_labels", "edit_undo", "tile", "page", "pack", "unpack", "export_kitti", "export_nuscenes", "convert_model",
         "convert_scene", "convert_path", "labels")
SLOWER = ("generate_along", "edit", "run")
LOOKS = ("open", "list", "entry", "stat", "mkdir")  # of the quick ones every call: what is not seen is left out
# each was not survived once: a kind's first call for a path that holds this
ONCE = {"render": (("write", "/out/drawn/color/"), ("stat", "/out/drawn/color")),
        "refine": (("create", "/out/refined/buffers/"), ("flush", "/out/refined/latents")),
        "refine_buffers": (("open", "/in/drawn/transforms.json"),),
        "generate_along": (("create", "/out/tiles/."), ("stat", "/in/ahead.tum"), ("list", "/out/tiles")),
        "export_transforms": (("stat", "/in/drawn/label/000000.npy"), ("stat", "/in/drawn/depth/000001.png")),
        "export_colmap": (("mkdir", "/sparse/0"),)}
WRITES = ("create", "write", "flush", "rename", "move", "mkdir", "unlink")


def spread(count, most):
    """-> numbers of 1 to count, evenly"""
    if most == "all" or int(most) >= count:
        return range(1, count + 1)
    most = int(most)
    return sorted({1 + (2 * i + 1) * count // (2 * most) for i in range(most)})


class Faults(SmallWorkTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.table = []

    @classmethod
    def tearDownClass(cls):
        print("\ncommand | calls | faults | ended with a line and went on to the same bytes | harmless")
        for row in cls.table:
            print(" | ".join(str(cell) for cell in row))

    def calls(self, line, name, **fault):
        """-> what is said of each call, and the process"""
        self.log.unlink(missing_ok=True)
        done = self.work.run(line, name=name, LD_PRELOAD=LIBRARY, FAULT_LOG=str(self.log), **fault)
        return (self.log.read_text().splitlines() if self.log.exists() else []), done

    def test_every_command(self):
        for name, line in COMMANDS.items():
            if name in ONLY if ONLY[0] else name in (*QUICK, *SLOWER) or MOST != "1":
                self.command(name, line)

    def test_what_once_failed(self):
        for name, places in ONCE.items():
            calls = self.undisturbed(name, COMMANDS[name])
            for kind, place in places:
                of_kind = [entry.split(" ", 1)[1] for entry in calls if entry.startswith(kind + " ")]
                call = next(i + 1 for i, path in enumerate(of_kind) if place in path)
                with self.subTest(command=name, fault=f"{kind}:{call}", place=place):
                    self.assertNotEqual(self.fault(name, COMMANDS[name], kind, call, ERRORS[kind][0]), "not met")

    def undisturbed(self, name, line):
        """-> its calls"""
        self.work.clear()
        log, done = self.calls(line, name)
        self.assertEqual(done.returncode, 0, f"{name}: {done.stderr}")
        self.whole = self.work.results()
        self.went_on = {}  # {what lay there after a fault: what became of it}
        return log

    def command(self, name, line):
        log = self.undisturbed(name, line)
        counts = collections.Counter(entry.split(" ", 1)[0] for entry in log)
        happened = collections.Counter()
        for kind, count in sorted(counts.items()):
            if MOST == "1" and name in SLOWER and kind not in WRITES:
                continue
            for call in spread(count, "all" if kind in LOOKS and name in QUICK else MOST):
                for error in ERRORS[kind] if MOST != "1" else ERRORS[kind][:1]:
                    with self.subTest(command=name, fault=f"{kind}:{call}:{error}"):
                        happened[self.told(self.fault, name, line, kind, call, error)] += 1
        total = sum(happened.values())
        self.table.append((name, ", ".join(f"{k} {n}" for k, n in sorted(counts.items())), total, happened["line"],
                           happened["harmless"]))
        print(self.table[-1], flush=True)

    def told(self, check, *words):
        """a failure is said at once: hours may follow"""
        try:
            return check(*words)
        except AssertionError as failure:
            print(*words, str(failure).replace("\n", " "), flush=True)
            raise

    def fault(self, name, line, kind, call, error):
        self.work.clear()
        stays = (kind, error) in (("write", errno.ENOSPC), ("map", errno.ENOMEM))  # a full disk, say
        which = f"{kind}:{call}{'+' if stays else ''}:{error}"
        log, done = self.calls(line, name, FAULT=which)
        struck = [entry.split(" ", 2)[2] for entry in log if entry.startswith("FAULT ")]
        if not struck:
            return "not met"  # threads take turns in another order
        if kind != "unlink":
            self.assertEqual(self.work.temporaries(), [], f"left after {struck[0]}: {done.stderr}")
        if done.returncode == 0:
            self.assertEqual(self.differences(), {}, f"exit code 0 after {struck[0]}")
            return "harmless"
        self.expect_line(name, done, error if kind != "stat" else 0, struck[0])  # there, it seems: what reads it says why not
        self.expect_nothing_half_written(struck[0])
        self.expect_to_go_on(name, line, f"{which} of {struck[0]}: {done.stderr}")
        return "line"

    def expect_line(self, name, done, error, path):
        lines = [text for text in done.stderr.splitlines() if not text.startswith("semrover: warning: ")]
        reason = lines[:1]
        if name == "video":  # ffmpeg's lines, if there are any, say why
            reason = lines
            lines = [text for text in lines if text.startswith("semrover: ")]
        self.assertIn(done.returncode, CODES, done.stderr)
        self.assertEqual(len(lines), 2 if done.returncode == 7 else 1, f"{done.stderr} after {path}")  # 7: one a task
        for text in lines:
            self.assertTrue(text.startswith("semrover: error: "), text)
        self.assertIn("'", lines[0])
        if error > 0:
            self.assertIn(os.strerror(error), "\n".join(reason), f"after {path}")

    def expect_nothing_half_written(self, path):
        for file in self.work.files():
            name = str(file.relative_to(self.work.out))
            if name in self.whole and file.name != "run.json":
                self.assertEqual(essence(file), self.whole[name], f"{name} after {path}")

    def differences(self):
        return differences(self.whole, self.work.results())

    def expect_to_go_on(self, name, line, after):
        state = self.work.snapshot()
        if state not in self.went_on:
            again = self.work.run(line, name=name)
            if again.returncode == 2 and not self.differences():
                again.returncode = 0  # all was done: it says that it is there
            if again.returncode == 2 and name in BEGINS_AGAIN and "-y replaces" in again.stderr:
                again = self.work.run(line, ["-y"], name=name)
            self.went_on[state] = again.returncode, again.stderr, self.differences() if not again.returncode else {}
        self.assertEqual(self.went_on[state], (0, self.went_on[state][1], {}), after)


if __name__ == "__main__":
    unittest.main(verbosity=2)

#!/usr/bin/env python3
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Runs the commands of docs/tutorial.md in an empty folder, one after the other in one shell, and compares what they
print with what the page shows (ctest entry `tutorial`).

check.py REPO PROGRAM    the repository; the semrover that was built

A command is a line of an indented block that begins with "$ "; lines that end in a backslash go on. What follows, up to
the next command or the block's end, is shown: lines of its output in this order, "..." for any others.
"""
import os
import re
import subprocess
import sys
import tempfile

PAGE = "docs/tutorial.md"
MARK = "@@ command "


def commands_of(page):
    """-> [[line of the page, command, [shown line]]]"""
    found, goes_on = [], False
    for number, line in enumerate(page.split("\n"), 1):
        if not line.startswith("    "):
            goes_on = False
            continue
        text = line[4:]
        if goes_on:
            found[-1][1] += "\n" + text
        elif text.startswith("$ "):
            found.append([number, text[2:], []])
        elif found:
            found[-1][2].append(text)
        goes_on = (goes_on or text.startswith("$ ")) and text.endswith("\\")
    return found


def missing(shown, output):
    """the first line shown that the output does not have, after those before it"""
    lines = iter(output.split("\n"))
    return next((line for line in shown if line != "..." and line not in lines), None)


def main():
    repository, program = map(os.path.abspath, sys.argv[1:3])
    with open(os.path.join(repository, PAGE), encoding="utf-8") as file:
        commands = commands_of(file.read())
    script = "set -e\n"
    for index, (_, command, _) in enumerate(commands):
        if command.startswith("REPO="):  # where the reader's clone is
            command = f"REPO={repository}"
        elif command.startswith("PATH="):
            command = f"PATH={os.path.dirname(program)}:$PATH"
        script += f"echo '{MARK}{index}'\n{command}\n"
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(["sh", "-c", script], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, check=False)
    outputs = re.split(rf"^{MARK}\d+\n", done.stdout, flags=re.M)[1:]
    wrong = [f"{PAGE}:{number}: not shown by '{command}': {line}\n{output}"
             for (number, command, shown), output in zip(commands, outputs)
             for line in [missing(shown, output)] if line is not None]
    if done.returncode or len(outputs) < len(commands):
        number, command, _ = commands[max(len(outputs) - 1, 0)]
        wrong.append(f"{PAGE}:{number}: '{command}' ended with {done.returncode}\n{outputs[-1] if outputs else ''}")
    print("\n".join(wrong) or f"{len(commands)} commands as {PAGE} says")
    return 1 if wrong or not commands else 0


if __name__ == "__main__":
    sys.exit(main())

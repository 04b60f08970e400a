#!/usr/bin/env python3
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the functions and types of the headers with those that were recorded: a change that programs which are built
already would notice must be meant. And the library has these functions and no other.

check.py FOLDER LIBRARY [--write]     FOLDER: of the headers. Needs Debian's abigail-tools
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile

HEADERS = ("semrover.h", "semrover_draw.h", "semrover_renderer.h", "semrover_vulkan.h", "semrover_gl.h")
RECORDED = os.path.join(os.path.dirname(os.path.abspath(__file__)), "semrover.abi")
PROTOTYPE = re.compile(r"^SR_API ([\w *]+[ *]sr_\w+\([^;]*\));", re.M)
QUIET = ("--no-show-locs", "--no-comp-dir-path", "--no-corpus-path", "--no-architecture", "--no-elf-needed")


def make_empty(headers, folder):
    """a library of empty functions: the headers alone say what they take"""
    text = ""
    for name in HEADERS:
        with open(os.path.join(headers, name), encoding="utf-8") as file:
            text += re.sub(r"/\*.*?\*/", "", file.read(), flags=re.S)
    functions = [m[1] + " { __builtin_trap(); }" for m in PROTOTYPE.finditer(text)]
    library = os.path.join(folder, "libsemrover.so")
    with open(os.path.join(folder, "empty.c"), "w", encoding="utf-8") as file:
        file.write("\n".join([f'#include "{name}"' for name in HEADERS] + functions) + "\n")
    subprocess.run(["cc", "-std=c99", "-Wno-pedantic", "-g", "-shared", "-fPIC",
                    "-I" + os.path.abspath(headers), "-o", library, "empty.c"], check=True, cwd=folder)
    return library


def functions_of(library):
    listed = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True).stdout
    return set(re.findall(r" T (sr_\w+)", listed))


def main(headers, library, *options):
    with tempfile.TemporaryDirectory() as folder:
        empty = make_empty(headers, folder)
        declared, there = functions_of(empty), functions_of(library)
        if declared != there or not there:
            sys.exit(f"declared and not there: {declared - there}; there and not declared: {there - declared}")
        now = os.path.join(folder, "now.abi")
        subprocess.run(["abidw", *QUIET, "--out-file", now, empty], check=True)
        if options == ("--write",):
            shutil.copyfile(now, RECORDED)
            return
        if subprocess.run(["abidiff", RECORDED, now]).returncode:
            sys.exit(f"the interface is another than recorded; if it shall be: {sys.argv[0]} {headers} {library} --write")


if __name__ == "__main__":
    main(*sys.argv[1:])

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""compile_options.py BUILD PROGRAM...: in a release build everything is optimized.

The linker keeps one copy of an inline function for a whole program. One source that is compiled with -O0 makes that
copy slow for all others, a writer of pictures included.
"""
import json
import re
import subprocess
import sys


def not_optimized(commands):
    """files whose last -O, which counts, is -O0, or that have none"""
    found = []
    for entry in commands:
        levels = re.findall(r"(?<=\s)-O([0-9a-z]*)(?=\s)", entry["command"])
        if not levels or levels[-1] == "0":
            found.append(entry["file"])
    return found


def copies(symbols):
    """functions that GCC always inlines, unless it does not optimize"""
    return [line for line in symbols.splitlines() if line.endswith(" std::is_constant_evaluated()")]


def main(build, programs):
    # what it would find
    flags = {"": 1, "-O3": 0, "-O3 -DNDEBUG -O1": 0, "-O3 -O0": 1, "-O0": 1, "-O0 -O2": 0, "-g -Os": 0}
    for text, count in flags.items():
        assert len(not_optimized([{"file": "a", "command": f"c++ {text} -c a"}])) == count, text
    assert copies("0000 W std::is_constant_evaluated()")
    with open(f"{build}/CMakeCache.txt") as cache:
        kind = re.search("^CMAKE_BUILD_TYPE:[A-Z]*=(.*)$", cache.read(), re.MULTILINE)
    if not kind or kind[1] != "Release":
        return 77  # skipped: what is debugged is not optimized
    with open(f"{build}/compile_commands.json") as file:
        commands = json.load(file)
    assert len(commands) > 50, f"{len(commands)} commands: where are the others?"
    faults = [f"{name} is not optimized" for name in not_optimized(commands)]
    for program in programs:
        symbols = subprocess.run(["nm", "-C", program], capture_output=True, text=True, check=True).stdout
        assert symbols, f"{program} has no symbols"
        faults += [f"{program} has a copy of a function that was not optimized: {line}" for line in copies(symbols)]
    print("\n".join(faults))
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))

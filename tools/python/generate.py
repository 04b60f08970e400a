#!/usr/bin/env python3
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Makes semrover/_abi.py of the C headers: structures, constants and functions for ctypes.

generate.py HEADERS [--check]    HEADERS: their folder; --check: fails if the file is another one
"""
import pathlib
import re
import sys

NAMES = ("semrover.h", "semrover_draw.h", "semrover_renderer.h")
OUTPUT = pathlib.Path(__file__).parent / "semrover" / "_abi.py"
HEAD = '''# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# Written by tools/python/generate.py of the C headers; not to be edited.
from ctypes import (CFUNCTYPE, POINTER, c_char, c_char_p, c_double, c_float, c_int32, c_int64, c_size_t, c_uint8, c_uint16,
                    c_uint32, c_uint64, c_void_p)

from ._numbers import Structure
'''
SCALARS = {"int32_t": "c_int32", "int64_t": "c_int64", "uint8_t": "c_uint8", "uint16_t": "c_uint16",
           "uint32_t": "c_uint32", "uint64_t": "c_uint64", "size_t": "c_size_t", "float": "c_float",
           "double": "c_double", "char": "c_char", "sr_status": "c_int32"}  # whose enum is 32 bits


class Header:
    def __init__(self, text):
        text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
        text = re.sub(r"#ifdef __cplusplus.*?#(?:else|endif)", "", text, flags=re.S)
        self.constants = re.findall(r"^#define (SR_\w+) (0x[0-9a-f]+|\d+)u?\s*$", text, flags=re.M)
        for body in re.findall(r"typedef enum \w+ \{(.*?)\}", text, flags=re.S):
            self.constants += re.findall(r"(SR_\w+) = (0x[0-9a-f]+|\d+)", body)
        self.structs = {name: self.members(body)
                        for body, name in re.findall(r"typedef struct \w+ \{(.*?)\} (\w+);", text, flags=re.S)}
        self.functions = re.findall(r"^SR_API ([\w *]+?)\b(sr_\w+)\((.*?)\);", text, flags=re.M | re.S)

    @staticmethod
    def members(body):
        """[(declarators, type)] in order"""
        return [" ".join(line.split()) for line in body.split(";") if line.strip()]


def pointed(kind, stars, structs):
    """ctypes' name of a C type"""
    kind = re.sub(r"\b(const|struct)\b", "", kind).strip()
    if not stars:
        return "None" if kind == "void" else SCALARS.get(kind, kind)
    if kind == "char" and stars == 1:
        return "c_char_p"
    if kind in SCALARS or kind in structs:
        inner = pointed(kind, stars - 1, structs)
        return f"POINTER({inner})"
    return "c_void_p" if stars == 1 else f"POINTER({pointed(kind, stars - 1, structs)})"  # handles, Vulkan's, void


def parameter(text, structs):
    """ctypes' name of a parameter's type"""
    text = " ".join(text.split())
    function = re.fullmatch(r"(.*?)\(\*\w*\)\((.*)\)", text)
    if function:
        return callback(function[1], function[2], structs)
    kind, name = re.fullmatch(r"(.*?[\s*])(\w+(?:\[\d+\])?)", text).groups()
    return pointed(kind.replace("*", " "), kind.count("*") + name.count("["), structs)


def callback(result, parameters, structs):
    kinds = [parameter(p, structs) for p in split_parameters(parameters)]
    return f"CFUNCTYPE({', '.join([pointed(result.replace('*', ' '), result.count('*'), structs), *kinds])})"


def split_parameters(text):
    parts, depth = [""], 0
    for c in text:
        depth += (c == "(") - (c == ")")
        if c == "," and not depth:
            parts.append("")
        else:
            parts[-1] += c
    return [p.strip() for p in parts if p.strip() not in ("", "void")]


def fields(lines, structs):
    for line in lines:
        function = re.fullmatch(r"(.*?)\(\*(\w+)\)\((.*)\)", line)
        if function:
            yield function[2], callback(function[1], function[3], structs)
            continue
        first, *others = line.split(",")
        kind, name = re.fullmatch(r"(.*?[\s*])(\w+(?:\[\w+\])*)", first.strip()).groups()
        for declared in [name, *(o.strip() for o in others)]:
            name, *sizes = re.findall(r"\w+", declared)
            made = pointed(kind.replace("*", " "), kind.count("*"), structs)
            yield name, "".join([made, *(f" * {size}" for size in reversed(sizes))])


def generate(folder):
    headers = [Header((folder / name).read_text(encoding="utf-8")) for name in NAMES]
    structs = {name: members for h in headers for name, members in h.structs.items()}
    out = [HEAD]
    out += [f"{name} = {value}" for h in headers for name, value in h.constants]
    for name, members in structs.items():
        lines = [f'("{field}", {kind})' for field, kind in fields(members, structs)]
        out.append(f"\n\nclass {name}(Structure):\n    _fields_ = [" + ",\n                ".join(lines) + "]")
    out.append("\n\n# name: (result, parameters)\nFUNCTIONS = {")
    for h in headers:
        for result, name, parameters in h.functions:
            kinds = [parameter(p, structs) for p in split_parameters(parameters)]
            kind = pointed(result.replace("*", " "), result.count("*"), structs)
            out.append(f'    "{name}": ({kind}, [{", ".join(kinds)}]),')
    out.append("}\n")
    return "\n".join(out)


def main(folder, *options):
    text = generate(pathlib.Path(folder))
    if options != ("--check",):
        OUTPUT.write_text(text, encoding="utf-8")
    elif OUTPUT.read_text(encoding="utf-8") != text:
        sys.exit(f"{OUTPUT} is not that of the headers: {sys.argv[0]} {folder}")


if __name__ == "__main__":
    main(*sys.argv[1:])

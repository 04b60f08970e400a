# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The structures of the Python package, to be compared with what a compiler of C makes of the headers."""
import ctypes


def checks(abi):
    """-> C that compiles only if each structure of `abi`, the package's _abi, has its size and offsets there"""
    kinds = [kind for kind in vars(abi).values()
             if isinstance(kind, type) and issubclass(kind, ctypes.Structure) and hasattr(kind, "_fields_")]
    assert len(kinds) > 20, len(kinds)
    lines = ['#include "semrover.h"', "#include <stddef.h>"]
    for kind in kinds:
        name = kind.__name__
        lines.append(f'_Static_assert(sizeof({name}) == {ctypes.sizeof(kind)}, "{name}");')
        lines += [f'_Static_assert(offsetof({name}, {f}) == {getattr(kind, f).offset}, "{name}.{f}");'
                  for f, *_ in kind._fields_]
    return "\n".join(lines) + "\n"

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers on their way to C. ctypes drops the bits that a type has no room for; here they are an OverflowError."""
import ctypes
import numbers


def _refuse(what, value, kept):
    """raises where a whole number became another"""
    if isinstance(value, numbers.Integral) and isinstance(kept, int) and kept != value:
        raise OverflowError(f"{what}: {value} is out of the range of its type")
    if isinstance(kept, ctypes.Array) and not isinstance(value, ctypes.Array):
        for one, other in zip(value, kept):
            _refuse(what, one, other)


class Structure(ctypes.Structure):
    """one whose members refuse whole numbers that they have no room for"""

    def __setattr__(self, name, value):
        super().__setattr__(name, value)
        _refuse(name, value, getattr(self, name))


def checked(kind):
    """a parameter's type that refuses such numbers"""
    if not (isinstance(kind, type) and issubclass(kind, ctypes._SimpleCData) and kind._type_ in "bBhHiIlLqQ"):
        return kind

    class Checked(kind):
        @classmethod
        def from_param(cls, value):
            if isinstance(value, kind):
                return value
            made = kind(value)
            _refuse("argument", value, made.value)
            return made

    return Checked

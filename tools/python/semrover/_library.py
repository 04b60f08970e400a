# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The shared library, its calls and their errors."""
import ctypes
import ctypes.util
import os
import threading
import weakref

from . import _abi
from ._numbers import checked


class Error(RuntimeError):
    """A call that failed; says in one line what was expected and what was found."""

    status = None  # sr_status of the call


class UsageError(Error, ValueError):
    """The call is wrong: a size, a number out of range or not finite, a handle that is closed."""


class BadInputError(Error, ValueError):
    """A file or what is in it."""


class NoDeviceError(Error):
    """No Vulkan device that can do it."""


class OutOfMemoryError(Error, MemoryError):
    """Memory of the device, of the budget, or of the host."""


class DeviceLostError(Error):
    """The device or its driver gave up."""


class PartialError(Error):
    """There was more than fitted."""


class InternalError(Error):
    """A bug of the library."""


class InterruptedError(Error):
    """A callback gave up."""


_ERRORS = {_abi.SR_ERR_USAGE: UsageError, _abi.SR_ERR_BAD_INPUT: BadInputError, _abi.SR_ERR_NO_DEVICE: NoDeviceError,
           _abi.SR_ERR_OUT_OF_MEMORY: OutOfMemoryError, _abi.SR_ERR_DEVICE_LOST: DeviceLostError,
           _abi.SR_ERR_PARTIAL: PartialError, _abi.SR_ERR_INTERNAL: InternalError,
           _abi.SR_ERR_INTERRUPTED: InterruptedError}


def _names():
    """where the library may be, best first"""
    given = os.environ.get("SEMROVER_LIBRARY")
    if given:
        return [given]
    if os.name == "nt":
        return ["semrover.dll"]
    return ["libsemrover.so.0", *filter(None, [ctypes.util.find_library("semrover")])]


def _open():
    tried = []
    for name in _names():
        try:
            library = ctypes.CDLL(name)
        except OSError as error:
            tried.append(str(error))
            continue
        for function, (result, parameters) in _abi.FUNCTIONS.items():
            try:
                made = getattr(library, function)
            except AttributeError:
                raise ImportError(f"{name} has no {function}: it is older than this package") from None
            made.restype, made.argtypes = result, [checked(p) for p in parameters]
        if library.sr_abi_version() != _abi.SR_ABI_VERSION:
            raise ImportError(f"{name} has version {library.sr_abi_version()} of the interface, this package "
                              f"{_abi.SR_ABI_VERSION}")
        return library
    raise ImportError("libsemrover is not found (set SEMROVER_LIBRARY to its path): " + "; ".join(tried))


lib = _open()
_raised = threading.local()  # by a callback of this thread


def made(kind, **members):
    """a structure with its struct_size"""
    value = kind(**members)
    value.struct_size = ctypes.sizeof(kind)
    return value


def check(status, context=None):
    """raises what a status says; context: that the call was about"""
    raised, _raised.error = getattr(_raised, "error", None), None
    if raised is not None:
        raise raised
    if status == _abi.SR_OK:
        return
    size = lib.sr_last_error(context, None, 0)
    line = ctypes.create_string_buffer(size + 1)
    lib.sr_last_error(context, line, size + 1)
    text = line.value.decode("utf-8", "replace") or lib.sr_status_name(status).decode()
    error = _ERRORS.get(status, Error)(text)
    error.status = status
    raise error


def guarded(function, failed):
    """a callback whose exception the call raises that it is called from; `failed`: what C gets then"""
    def call(*arguments):
        try:
            return function(*arguments)
        except BaseException as error:  # KeyboardInterrupt, too
            _raised.error = error
            return failed
    return call


def lines_to(kind, function):
    """a callback of a C type that hands lines of text to a function"""
    return kind(guarded(lambda user, line: function(line.decode("utf-8", "replace")), None))


def fields_of(kind, structure):
    """a dataclass of the members of a structure that have its names"""
    return kind(**{name: getattr(structure, name) for name in kind.__dataclass_fields__})


class Handle:
    """What the library made, closed before what it was made with. A context manager; closing twice is fine."""

    def __init__(self, pointer, destroy, parent=None, keep=()):
        self._pointer = pointer
        self._children = weakref.WeakSet()
        self._parent, self._keep = parent, keep
        if parent is not None:
            parent._children.add(self)
        self._finalizer = weakref.finalize(self, _destroy, destroy, pointer, parent, keep)

    @property
    def handle(self):
        """the C handle. UsageError if it is closed"""
        if not self._finalizer.alive:
            raise UsageError(f"this {type(self).__name__} is closed")
        return self._pointer

    @property
    def closed(self):
        return not self._finalizer.alive

    def close(self):
        """Frees it, after what was made with it."""
        for child in list(self._children):
            child.close()
        self._finalizer()

    def _check(self, status):  # of a call about what was made with a context
        check(status, self._parent._pointer)

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.close()


def _destroy(destroy, pointer, parent, keep):  # parent and keep live as long as the pointer
    destroy(pointer)

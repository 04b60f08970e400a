# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Devices and contexts."""
import ctypes
from dataclasses import dataclass

from . import _abi
from ._library import Handle, check, lib, lines_to, made


@dataclass(frozen=True)
class Device:
    """A Vulkan device."""

    index: int  # for Context(device=..)
    name: str
    driver: str
    refusal: str  # why it cannot be used; "" if it can
    type: str  # "discrete", "integrated", "other", "cpu"
    api: str
    memory_bytes: int  # of the largest device-local heap


def _device(info):
    return Device(info.index, *(getattr(info, name).decode("utf-8", "replace")
                                for name in ("name", "driver", "refusal", "type", "api")), info.memory_bytes)


def devices():
    """All Vulkan devices, best first."""
    count = ctypes.c_uint32()
    check(lib.sr_list_devices(None, count))
    if not count.value:
        return []
    infos = (_abi.sr_device_info * count.value)()
    infos[0].struct_size = ctypes.sizeof(_abi.sr_device_info)
    check(lib.sr_list_devices(infos, count))
    return [_device(info) for info in infos[:count.value]]


@dataclass(frozen=True)
class Memory:
    """Device memory of a context, bytes."""

    used: int
    peak: int
    budget: int  # 0: none


class Context(Handle):
    """One device and what lives on it. Use it, and all that is made with it, from one thread at a time; World.step and
    World.draw may run on a worker and a render thread at once.

    device: an index, UUID, PCI address or part of a name; None: the best. max_bytes: of device memory; 0: no budget.
    validation: Khronos validation, whose lines on_diagnostic() gets.
    """

    def __init__(self, device=None, max_bytes=0, validation=False):
        desc = made(_abi.sr_context_desc, validation=bool(validation), max_bytes=max_bytes,
                    device=None if device is None else str(device).encode())
        pointer = ctypes.c_void_p()
        check(lib.sr_context_create(desc, pointer))
        super().__init__(pointer, lib.sr_context_destroy)

    @property
    def device(self):
        """the Device"""
        info = made(_abi.sr_device_info)
        self._check(lib.sr_context_get_device(self.handle, info))
        return _device(info)

    @property
    def memory(self):
        """Memory now"""
        info = made(_abi.sr_memory_info)
        self._check(lib.sr_context_get_memory(self.handle, info))
        return Memory(info.used_bytes, info.peak_bytes, info.budget_bytes)

    def _check(self, status):
        check(status, self._pointer)


_diagnostics = None  # that the library has


def on_diagnostic(function):
    """function(line) gets the lines that no call returns, of the whole process; None: nobody."""
    global _diagnostics
    kind = _abi.FUNCTIONS["sr_set_diagnostic_callback"][1][0]
    callback = kind() if function is None else lines_to(kind, function)
    lib.sr_set_diagnostic_callback(callback, None)
    _diagnostics = callback

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Networks on the device."""
import ctypes
import os
from dataclasses import dataclass

from . import _abi
from ._library import Handle, fields_of, guarded, lib, made

VOXFIELD, RENDERER = _abi.SR_MODEL_VOXFIELD, _abi.SR_MODEL_RENDERER
_PRECISIONS = {"fp16": _abi.SR_FP16, "fp32": _abi.SR_FP32}


@dataclass(frozen=True)
class ModelInfo:
    """What a model has; fields as of sr_model_info."""

    parts: int  # VOXFIELD | RENDERER
    precision: int
    conditions: int
    device_bytes: int
    voxel_size: float  # metres
    points_per_voxel: int
    steps: int
    renderer_steps: int
    window_frames: int
    splat_radius: float  # metres; 0: from the distance of the points


class Model(Handle):
    """Networks, loaded once for any number of worlds and renderers.

    path: a folder, or a renderer's .safetensors file. parts: VOXFIELD, RENDERER or both, which must be there; 0: what
    there is. precision: "fp16" or "fp32". progress(done, total), bytes: what is not None and not 0 gives up
    (InterruptedError); an exception in it is raised here. preset: one of `presets` in model_index.json.
    """

    def __init__(self, context, path, parts=0, precision="fp16", progress=None, preset=None):
        if precision not in _PRECISIONS:
            raise ValueError(f"precision: expected one of {', '.join(_PRECISIONS)}, found {precision!r}")
        desc = made(_abi.sr_model_desc, parts=parts, path=os.fsencode(path), precision=_PRECISIONS[precision])
        if preset is not None:
            desc.preset = os.fsencode(preset)
        if progress is not None:
            desc.progress = type(desc.progress)(guarded(lambda user, done, total: int(progress(done, total) or 0), 1))
        pointer = ctypes.c_void_p()
        context._check(lib.sr_model_load(context.handle, desc, pointer))
        super().__init__(pointer, lib.sr_model_destroy, context)
        self.context = context

    @property
    def info(self):
        """ModelInfo"""
        info = made(_abi.sr_model_info)
        self._check(lib.sr_model_get_info(self.handle, info))
        return fields_of(ModelInfo, info)

    def generation(self, **changes):
        """sr_generation of the model's settings with some changed, for World(generation=..)"""
        settings = made(_abi.sr_generation)
        self._check(lib.sr_model_get_generation(self.handle, settings))
        for name, value in changes.items():
            if name not in dict(settings._fields_):
                raise TypeError(f"generation: no setting is called {name!r}")
            setattr(settings, name, value)
        return settings

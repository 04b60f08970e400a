# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""safetensors files, which Debian 12 has no package for: 8 bytes of length, a JSON header, the tensors' bytes.

Source: https://github.com/huggingface/safetensors#format
"""
import json
import os
import struct

import numpy as np
import torch

_TORCH = {"F64": torch.float64, "F32": torch.float32, "F16": torch.float16, "BF16": torch.bfloat16, "I64": torch.int64,
          "I32": torch.int32, "I16": torch.int16, "I8": torch.int8, "U8": torch.uint8, "BOOL": torch.bool}
_NAME = {dtype: name for name, dtype in _TORCH.items()}


def read_header(path):
    """-> ({name: {dtype, shape, data_offsets}}, metadata, position of the first tensor byte)"""
    with open(path, "rb") as file:
        prefix = file.read(8)
        if len(prefix) < 8:
            raise ValueError(f"{path}: not a safetensors file, it has only {len(prefix)} bytes")
        length = struct.unpack("<Q", prefix)[0]
        if length > os.path.getsize(path) - 8:
            raise ValueError(f"{path}: the header should have {length} bytes, the file ends before")
        header = json.loads(file.read(length))
    metadata = header.pop("__metadata__", {})
    return header, metadata, 8 + length


def read(path, names=None, mapped=False):
    """-> {name: torch tensor}, all or those named; copies, or mapped to memory: read from the file when looked at"""
    header, _, start = read_header(path)
    data = np.memmap(path, np.uint8, "c")
    tensors = {}
    for name, about in header.items():
        if names is not None and name not in names:
            continue
        first, last = about["data_offsets"]
        raw, dtype = data[start + first:start + last], _TORCH[about["dtype"]]
        aligned = raw.ctypes.data % torch.empty((), dtype=dtype).element_size() == 0
        raw = torch.from_numpy(raw if mapped and aligned else np.array(raw))
        tensors[name] = raw.view(dtype).reshape(about["shape"])
    return tensors


def write(path, tensors, metadata=None):
    """{name: torch tensor}; under a temporary name first, then renamed"""
    header, at = {}, 0
    if metadata:
        header["__metadata__"] = {key: str(value) for key, value in metadata.items()}
    order = sorted(tensors)
    for name in order:
        tensor = tensors[name]
        size = tensor.numel() * tensor.element_size()
        header[name] = {"dtype": _NAME[tensor.dtype], "shape": list(tensor.shape), "data_offsets": [at, at + size]}
        at += size
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    passing = f"{path}.part"
    with open(passing, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text)
        for name in order:
            flat = tensors[name].detach().cpu().contiguous().reshape(-1)
            file.write(flat.view(torch.uint8).numpy().tobytes() if flat.numel() else b"")
    os.replace(passing, path)

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Which numbers a recipe computes with: bf16 where this machine multiplies matrices of it correctly, else fp32."""
import contextlib
import functools

import torch


@functools.lru_cache(maxsize=None)
def sums_in_fp32(device):
    """Whether products of bf16 matrices are added up in fp32. PyTorch 1.13 on a CPU without AVX-512 adds them up in
    bf16, where 256 + 1 is 256: gradients of weights, which are sums over all rows of a batch, are up to 23 % off, and
    a step takes four to ten times as long as in fp32 (tests/test_precision.py)."""
    if torch.device(device).type != "cpu":
        return True
    ones = torch.ones(1024, 16, dtype=torch.bfloat16)
    with torch.no_grad():
        return bool((ones.t() @ ones == 1024).all())


def autocast(precision, device):
    """the context that networks of a recipe run in; precision: bf16 or fp32. Without PyTorch's cache of weights in bf16:
    one that is made under no_grad has no gradients, and a later run of the network in the same step would take it"""
    if precision == "fp32" or not sums_in_fp32(device):
        return contextlib.nullcontext()
    return torch.autocast(torch.device(device).type, dtype=torch.bfloat16, cache_enabled=False)


def why_not(precision, device):
    """a sentence for the user where `autocast` does not use the precision asked for, else None"""
    if precision == "fp32" or sums_in_fp32(device):
        return None
    return (f"computing in fp32 in place of {precision}: PyTorch {torch.__version__} on this CPU adds up {precision} "
            "products in bf16, which spoils gradients and is slower")

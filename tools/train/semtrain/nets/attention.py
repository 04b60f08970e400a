# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The attention of all networks."""
import torch
from torch.nn import functional as F

from ..precision import sums_in_fp32


def attend(q, k, v, mask=None):
    """softmax(q k^T / sqrt(d) + mask) v: q [.., N, d], k and v [.., M, d], mask [.., N, M] -> [.., N, d].
    In fp32 where bf16 products go wrong, even if the caller's autocast says bf16."""
    dtype = v.dtype
    if dtype == torch.float32 or sums_in_fp32(v.device):
        return attention_of(q, k, v, mask)
    with torch.autocast(v.device.type, enabled=False):
        return attention_of(q.float(), k.float(), v.float(), mask).to(dtype)


def fused(q, k, v, mask):
    """by PyTorch's own kernels, which keep no [N, M] matrix for the backward pass; they want four dimensions"""
    if q.dim() == 3:
        return fused(q[:, None], k[:, None], v[:, None], mask)[:, 0]
    return F.scaled_dot_product_attention(q, k, v, None if mask is None else mask.to(q.dtype))


def written_out(q, k, v, mask):
    scores = (q * q.shape[-1] ** -0.5) @ k.transpose(-1, -2)
    if mask is not None:
        scores = scores + mask.to(scores.dtype)
    return torch.softmax(scores, -1).to(v.dtype) @ v


attention_of = fused if hasattr(F, "scaled_dot_product_attention") else written_out  # PyTorch 1.13 has not

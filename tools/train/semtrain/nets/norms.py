# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Statistics of batch norms: averaged weights have others than those that were trained."""
import copy

import torch
from torch.nn.modules.batchnorm import _BatchNorm


def batch_norms(model):
    return [m for m in model.modules() if isinstance(m, _BatchNorm)]


@torch.no_grad()
def measure_norms(model, batches):
    """running statistics of the batch norms := those of these batches, [the model's arguments], all weighing the same;
    then the model is ready to be asked"""
    for norm in batch_norms(model):
        norm.reset_running_stats()
        norm.momentum = None
    model.train()
    for arguments in batches:
        model(*arguments)
    model.eval()


def averaged(model, state, batches):
    """a copy on the CPU with the averaged weights `state`, its norms measured on the batches, ready to be asked"""
    own = copy.deepcopy(model).cpu()
    own.load_state_dict(state, strict=False)
    measure_norms(own, batches)
    return own

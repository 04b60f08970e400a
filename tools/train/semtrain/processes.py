# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The processes that train one network together, started by torchrun or srun: each has the whole network and computes
a part of every batch. A process that neither started is alone."""
import contextlib
import datetime
import os
import re
import sys

import torch
from torch import distributed

PATIENCE = datetime.timedelta(hours=12)  # for rank 0, which may make the cache of all grids before the first step
SMALL = 1 << 18  # numbers of a gradient


def first_host(node_list):
    """of Slurm's short form: gpu[07-09,12],login -> gpu07"""
    return re.sub(r"\[([^],-]+)[^]]*\]", r"\1", node_list).split(",")[0]


def rendezvous(environment):
    """what torch.distributed reads, as torchrun or srun gave it -> {name: value}, empty for a process that is alone"""
    e = environment
    if "RANK" in e and "WORLD_SIZE" in e:
        return {name: e[name] for name in ("RANK", "WORLD_SIZE", "LOCAL_RANK", "MASTER_ADDR", "MASTER_PORT")}
    if int(e.get("SLURM_STEP_NUM_TASKS", 1)) < 2:  # SLURM_NTASKS is also that of a batch script, which is one process
        return {}
    port = 15000 + (31 * int(e["SLURM_JOB_ID"]) + int(e["SLURM_STEP_ID"])) % 16000
    return {"RANK": e["SLURM_PROCID"], "WORLD_SIZE": e["SLURM_STEP_NUM_TASKS"], "LOCAL_RANK": e["SLURM_LOCALID"],
            "MASTER_ADDR": e.get("MASTER_ADDR") or first_host(e["SLURM_STEP_NODELIST"]),
            "MASTER_PORT": e.get("MASTER_PORT") or str(port)}


def join(device):
    """meets the other processes, and takes a GPU of the node's where `device` is cuda; only rank 0 prints"""
    found = rendezvous(os.environ)
    if not found or distributed.is_initialized():
        return
    os.environ.update(found)
    if device == "cuda":
        torch.cuda.set_device(int(found["LOCAL_RANK"]) % torch.cuda.device_count())  # srun may show each process one
    distributed.init_process_group("nccl" if device == "cuda" else "gloo", timeout=PATIENCE)
    if rank() > 0:
        sys.stdout = open(os.devnull, "w")


def leave():
    """after the others have come here, too"""
    if distributed.is_initialized():
        distributed.barrier()
        distributed.destroy_process_group()


def rank():
    return distributed.get_rank() if distributed.is_initialized() else 0


def count():
    return distributed.get_world_size() if distributed.is_initialized() else 1


def gathered(numbers):
    """a list of as many numbers in every process -> f64 [processes, numbers]"""
    own = torch.tensor(numbers, dtype=torch.float64)
    if count() == 1:
        return own[None]
    own = own.to("cuda" if distributed.get_backend() == "nccl" else "cpu")
    rows = [torch.empty_like(own) for _ in range(count())]
    distributed.all_gather(rows, own)
    return torch.stack(rows).cpu()


def share(tensors):
    """all have those of rank 0 from now on"""
    if count() > 1:
        for tensor in tensors:
            distributed.broadcast(tensor, 0)


def add_gradients(parameters):
    """every gradient := the sum of all processes'; small ones go together, as each message takes its time"""
    if count() == 1:
        return
    gradients = [p.grad for p in parameters if p.grad is not None]
    small = [g for g in gradients if g.numel() < SMALL]
    together = torch.cat([g.flatten() for g in small]) if small else None
    messages = [g for g in gradients if g.numel() >= SMALL] + ([together] if small else [])
    for done in [distributed.all_reduce(message, async_op=True) for message in messages]:
        done.wait()
    for g, part in zip(small, together.split([g.numel() for g in small]) if small else []):
        g.copy_(part.view(g.shape))


def divided(work, items):
    """[work(item)] of all items, in every process. Each does one in turn, and waits for the others; all end if one
    fails"""
    done = []
    for first in range(0, len(items), count()):
        own, of_all = None, [None] * count()
        try:
            own = [work(item) for item in items[first:first + count()][rank():rank() + 1]]
        finally:
            if count() > 1:
                distributed.all_gather_object(of_all, own)
            else:
                of_all = [own]
        if None in of_all:
            raise SystemExit(1)
        done += [result for results in of_all for result in results]
    return done


@contextlib.contextmanager
def rank_0_first():
    """rank 0 runs the block before the others do, which end, too, if it fails there: what it writes, they only read"""
    done = False
    if rank() > 0 and not gathered([0])[0, 0]:
        raise SystemExit(1)
    try:
        yield
        done = True
    finally:
        if rank() == 0:
            gathered([done])

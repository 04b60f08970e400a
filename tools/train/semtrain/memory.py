# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""How much memory a training step of a renderer or of the transformer holds, by part, in fp32: a table in Markdown.

Nothing is computed: the network runs on PyTorch's meta device, whose tensors have shapes alone. Counted is what stays
until the backward pass. With `recompute` that is the inputs of blocks, what is between blocks, and the activations of
the one block that is computed again. What an op needs while it runs is not counted.
"""
import argparse

import torch
from torch.overrides import TorchFunctionMode

from . import asd, settings, vsd
from .condition import width_of
from .nets import attention
from .nets.recompute import blocks_of
from .nets.transformer import VoxfieldTransformer

GIB = 2 ** 30


class OnMeta(TorchFunctionMode):
    """what a network makes has no memory"""

    def __torch_function__(self, function, types, arguments=(), more=None):
        more = dict(more or {})
        if function in (torch.empty, torch.zeros, torch.tensor):
            more["device"] = "meta"
        if function is torch.Tensor.repeat_interleave:  # by a number, whose value PyTorch 1.13 would not know
            more["output_size"] = arguments[0].shape[arguments[2]] * arguments[1]
        return function(*arguments, **more)


class FusedAttention(torch.autograd.Function):
    """keeps what a fused kernel keeps: queries, keys, values, the result, and a number a query"""

    @staticmethod
    def forward(context, q, k, v, mask):
        out = torch.empty((*q.shape[:-1], v.shape[-1]), device=q.device)
        context.save_for_backward(q, k, v, out, torch.empty(q.shape[:-1], device=q.device))
        return out

    @staticmethod
    def backward(context, _):
        raise NotImplementedError


def network_of(recipe, config):
    """-> a network and its arguments, all on the meta device"""
    def empty(*shape):
        return torch.empty(shape, device="meta")
    batch = config["batch"] // config["accumulate"]
    if recipe == "transformer":
        network, n = config["network"], config["set_size"][1]
        model, width = VoxfieldTransformer(**network), width_of(network.get("condition", ()))
        return model, [empty(batch, n, 6 * network["points_per_voxel"]), empty(batch, n).long(), empty(batch, n, 3),
                       empty(batch, n).bool(), empty(batch), *([empty(batch, n, width)] if width else [])]
    if recipe == "asd":
        latents, visible = empty(batch, 4, *config["crop"]), empty(batch, 1, *config["crop"])
        return asd.Renderer(config), [latents, latents, latents, visible, empty(batch)]
    frames = batch, config["num_frames"]
    latents, visible = empty(*frames, 4, *config["crop"]), empty(*frames, 1, *config["crop"])
    return vsd.Renderer(config), [latents, latents, visible, empty(batch)]


def storage_of(tensor):
    return tensor.untyped_storage() if hasattr(tensor, "untyped_storage") else tensor.storage()


class Kept:
    """what a network keeps for the backward pass: {storage: bytes} of each block, of what is between blocks, and of the
    blocks' inputs"""

    def __init__(self, model, arguments, attend):
        self.blocks, self.between, self.inputs = [], {}, {}
        self.inside, parameters = None, {storage_of(p)._cdata for p in model.parameters()}
        for block in blocks_of(model):
            block.register_forward_pre_hook(self._enter)
            block.register_forward_hook(self._leave)

        def pack(tensor):
            if storage_of(tensor)._cdata not in parameters:
                self._add(self.between if self.inside is None else self.inside, tensor)
            return tensor
        before, attention.attention_of = attention.attention_of, attend
        try:
            with torch.autograd.graph.saved_tensors_hooks(pack, lambda tensor: tensor):
                self.out = model(*arguments)  # which holds the graph, so that no storage is another's later
        finally:
            attention.attention_of = before

    def whole(self):
        return self._sum(self.between, *self.blocks)

    def recomputed(self):
        kept = {**self.between, **self.inputs}
        largest = max(self._sum({key: size for key, size in block.items() if key not in kept}) for block in self.blocks)
        return self._sum(kept) + largest

    @staticmethod
    def _sum(*parts):
        return sum({key: size for part in parts for key, size in part.items()}.values())

    @staticmethod
    def _add(part, tensor):
        part[storage_of(tensor)._cdata] = storage_of(tensor).nbytes()

    def _enter(self, _, arguments):
        self.inside = {}
        self.blocks.append(self.inside)
        for tensor in arguments:
            if isinstance(tensor, torch.Tensor):
                self._add(self.inputs, tensor)

    def _leave(self, *_):
        self.inside = None


def bytes_of(recipe, config):
    """-> {part: bytes} of the parts that always are there, then {how: bytes} of activations"""
    found = {}
    for name, attend in (("attention written out", attention.written_out), ("attention fused", FusedAttention.apply)):
        with OnMeta():
            model, arguments = network_of(recipe, config)
            kept = Kept(model, arguments, attend)
        found[name], found[name + ", blocks recomputed"] = kept.whole(), kept.recomputed()
    trained = sum(4 * p.numel() for p in model.parameters() if p.requires_grad)
    weights = sum(4 * p.numel() for p in model.parameters())
    return {"weights": weights, "gradients": trained, "Adam": 2 * trained, "average": weights}, found


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run memory", description=__doc__.splitlines()[0])
    p.add_argument("recipe", choices=("asd", "vsd", "transformer"))
    p.add_argument("--config", default="paper", help="as of the recipe")
    p.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as of the recipe")
    p.add_argument("--threads", type=int, default=1, help="of the CPU; 0: all")
    options = p.parse_args(arguments)
    fixed, activations = bytes_of(options.recipe, settings.resolve(options.recipe, options))
    print("| part | GiB |\n|---|---|")
    for part, size in fixed.items():
        print(f"| {part} | {size / GIB:.1f} |")
    for how, size in activations.items():
        print(f"| activations, {how} | {size / GIB:.1f} |")
    for how, size in activations.items():
        print(f"| in all, {how} | {(size + sum(fixed.values())) / GIB:.1f} |")


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Each kind of op that a recipe computes in bf16, against fp32, forwards and backwards, at the sizes of the recipes."""
import contextlib
import io
import tempfile
import unittest

import torch
from torch import nn
from torch.nn import functional as F

from semtrain import precision
from semtrain.nets import inception, pointnet, transformer, unet, vae
from semtrain.nets.attention import attend
from semtrain.nets.image_blocks import Downsampler, GroupNorm, LayerNorm, ResnetBlock, Upsampler
from semtrain.trainer import Trainer

# bounds of errors. Measured where products are added up in fp32: 0.0041 of one op at most (rounding a value changes it
# by 0.0017 in the mean), 0.0104 of a few, 0.0181 where some values near 0 come out on the other side of a ReLU
ONE, FEW, KINKED = 0.006, 0.02, 0.03


class Case:
    """run(*inputs) with float inputs and `parts` (modules); `blind`: parameters whose gradient is 0, as what follows
    takes it out again"""

    def __init__(self, name, bound, run, inputs, parts=(), blind=()):
        self.name, self.bound, self.run, self.inputs = name, bound, run, inputs
        self.parts, self.blind = nn.ModuleList(parts), blind
        with torch.no_grad():
            for p in self.parts.parameters():
                p.copy_(p.bfloat16())

    def results(self, context):
        """{what: tensor} of the output and of all gradients; the output's own is random, the same in any context"""
        inputs = [x.detach().requires_grad_() for x in self.inputs]
        self.parts.zero_grad()
        with context:  # networks hand on what the layer before made: bf16
            y = self.run(*(x.bfloat16() if torch.is_autocast_cpu_enabled() else x for x in inputs))
        back = torch.randn(y.shape, generator=torch.Generator().manual_seed(7)).bfloat16()
        y.backward(back.to(y.dtype))
        found = {"output": y.detach().float()}
        found.update({f"gradient of input {i}": x.grad for i, x in enumerate(inputs)})
        found.update({f"gradient of {name}": p.grad.clone() for name, p in self.parts.named_parameters()
                      if p.grad is not None and not name.endswith(self.blind or "\0")})
        return found

    def error(self, context):
        """-> the largest error, as a share of the right tensor's norm, and where it is"""
        right, found = self.results(contextlib.nullcontext()), self.results(context)
        errors = {what: float((found[what].float() - t).norm() / t.norm()) if t.any() else
                  float(found[what].abs().max()) for what, t in right.items()}
        where = max(errors, key=errors.get)
        return errors[where], where


def random(*shape):
    """values that bf16 holds, so that what differs comes from the op"""
    return torch.randn(shape).bfloat16().float()


def picture(*shape):
    return random(*shape).contiguous(memory_format=torch.channels_last)


def image(module):
    return module.to(memory_format=torch.channels_last)


def of_module(name, bound, module, *inputs, blind=()):
    return Case(name, bound, module, inputs, [module], blind)


def transformer_cases():
    """transformer.small.json: 12 sets of up to 224 voxels, width 192, 3 heads of 64"""
    tokens, labels = random(12, 224, 192), torch.randint(21, (12, 224))
    mask = torch.zeros(12, 1, 448, 448).masked_fill_(torch.rand(12, 1, 448, 448) < 0.5, -1e9)
    embed, joint = nn.Embedding(21, 192), transformer.Attention(192, 3, last=False)
    time = transformer.TimeEmbedding(192)
    scale, shift = random(12, 1, 192), random(12, 1, 192)
    heads = [random(12, 3, 448, 64) for _ in range(3)]
    return [of_module("linear 192 -> 768", ONE, nn.Linear(192, 768), tokens),
            of_module("linear 768 -> 192", ONE, nn.Linear(768, 192), random(12, 224, 768)),
            of_module("linear 120 -> 192", ONE, nn.Linear(120, 192), random(12, 224, 120)),
            Case("embedding of labels", ONE, lambda: embed(labels), [], [embed]),
            Case("time embedding", FEW, lambda: time(torch.arange(12) * 83), [], [time]),
            of_module("modulation", FEW, transformer.Modulation(192, 6).linear, random(12, 192)),
            Case("layer norm, scaled and shifted", ONE,
                 lambda x, a, b: transformer.layer_norm(x) * (1 + a) + b, [tokens, scale, shift]),
            Case("gelu_tanh", ONE, transformer.gelu_tanh, [random(12, 224, 768)]),
            of_module("feed-forward", FEW, transformer.FeedForward(192), tokens),
            Case("attention of 448 tokens, masked", FEW, lambda q, k, v: attend(q, k, v, mask), heads),
            Case("joint attention", FEW, lambda x, c: torch.cat(joint(x, c, mask), 1), [tokens, random(12, 224, 192)],
                 [joint], ("to_k.bias", "add_k_proj.bias"))]


def asd_cases():
    """asd.small.json: 4 crops of 64 x 96 latents, 48 to 192 channels, transformers over 384 and 96 pixels"""
    wide, text = picture(4, 48, 64, 96), random(4, 77, 32)
    own, cross = unet.Attention(160, 160, 5), unet.Attention(160, 32, 5)
    pixels = random(4, 384, 160)  # and 77 words, as asd.paper.json has
    return [of_module("convolution 3x3, 48 -> 48", ONE, image(nn.Conv2d(48, 48, 3, padding=1)), wide),
            of_module("convolution 3x3, 13 -> 48", ONE, image(nn.Conv2d(13, 48, 3, padding=1)), picture(4, 13, 64, 96)),
            of_module("convolution 1x1, 96 -> 48", ONE, image(nn.Conv2d(96, 48, 1)), picture(4, 96, 64, 96)),
            of_module("downsampler", ONE, image(Downsampler(48, one_sided=False)), wide),
            of_module("upsampler", ONE, image(Upsampler(96)), picture(4, 96, 32, 48)),
            of_module("group norm", ONE, GroupNorm(16, 48), wide),
            of_module("layer norm", ONE, LayerNorm(160), pixels),
            Case("silu", ONE, lambda x: F.silu(x), [wide]),
            of_module("resnet block", FEW, image(ResnetBlock(96, 160, 16, 1e-5, 192)), picture(4, 96, 16, 24),
                      random(4, 192)),
            of_module("GEGLU", FEW, unet.FeedForward(160), pixels),
            Case("attention of 384 pixels", FEW, lambda x: own(x, x), [pixels], [own]),
            Case("attention to the text", FEW, cross, [pixels, text], [cross]),
            of_module("transformer of pixels", FEW, image(unet.Transformer2D(160, 32, 5, 1, 16, linear=False)),
                      picture(4, 160, 16, 24), text)]


def vae_cases():
    """vae.small.json: 6 crops of 96 x 96, 16 to 96 channels; the attention of vae.paper.json: 512 channels, 32 x 32"""
    return [of_module("convolution 3x3, 16 -> 16", ONE, image(nn.Conv2d(16, 16, 3, padding=1)), picture(6, 16, 96, 96)),
            of_module("convolution 3x3, 3 -> 16", ONE, image(nn.Conv2d(3, 16, 3, padding=1)), picture(6, 3, 96, 96)),
            of_module("one-sided downsampler", ONE, image(Downsampler(48, one_sided=True)), picture(6, 48, 48, 48)),
            of_module("resnet block", FEW, image(ResnetBlock(48, 96, 8, vae.EPS)), picture(6, 48, 24, 24)),
            of_module("attention of 1024 pixels", FEW, image(vae.SingleHeadAttention(512, 32)), picture(1, 512, 32, 32),
                      blind=("to_k.bias",))]


def recognition_cases():
    """pointnet.small.json: 12 x 512 groups of 16 points; inception.paper.json's kinds of layer, an eighth as wide"""
    mlp = pointnet.SharedMlp(9, [32], 2)
    points, members = random(12, 2048, 32), torch.randint(2048, (12, 128, 16))
    convolution = inception.Convolution(8, 16, (3, 3))
    weights = torch.softmax(random(12, 2048, 3), -1)
    index = torch.randint(128, (12, 2048, 3))
    rows = random(12 * 512 * 16, 9)
    return [Case("shared MLP with batch norm", KINKED, mlp.apply_to, [rows], [mlp], ("convs.0.bias",)),
            Case("largest of a group", ONE, lambda x: pointnet.take(x, members).max(2)[0], [points]),
            Case("sum of three neighbours", FEW,  # whose gradients are sums in bf16, of some 48 terms
                 lambda x: (pointnet.take(x, index) * weights[..., None].to(x.dtype)).sum(2), [random(12, 128, 128)]),
            of_module("convolution with batch norm", KINKED, image(convolution), picture(16, 8, 73, 73)),
            of_module("convolution 1x7", ONE, image(nn.Conv2d(16, 24, (1, 7), padding=(0, 3), bias=False)),
                      picture(16, 16, 17, 17)),
            Case("mean pool", ONE, lambda x: inception.pool_of(x, inception.MEAN), [picture(16, 24, 35, 35)]),
            Case("max pool", ONE, lambda x: inception.pool_of(x, inception.HALVE), [picture(16, 24, 35, 35)]),
            Case("mean of a picture", ONE, lambda x: x.mean((2, 3)), [picture(16, 256, 8, 8)])]


def bf16():
    return torch.autocast("cpu", dtype=torch.bfloat16)


def wrong(cases, context):
    """{op: by how much} of those beyond their bound; `context` makes what they run in"""
    found = {}
    for case in cases:
        error, where = case.error(context())
        if not error <= case.bound:
            found[case.name] = f"{error:.4f} off in the {where}; bound {case.bound}"
    return found


def as_text(found):
    return "".join(f"\n  {name}: {about}" for name, about in found.items())


@contextlib.contextmanager
def without_avx512():
    """PyTorch as on a CPU without AVX-512: there, too, its own loops multiply bf16 matrices, not oneDNN"""
    with torch.backends.mkldnn.flags(enabled=False):
        precision.sums_in_fp32.cache_clear()
        try:
            yield
        finally:
            precision.sums_in_fp32.cache_clear()


class EachOp(unittest.TestCase):
    def setUp(self):
        torch.manual_seed(1)

    def test_is_right_in_bf16_or_recipes_do_without_bf16(self):
        found = wrong(transformer_cases() + asd_cases() + vae_cases() + recognition_cases(), bf16)
        if precision.sums_in_fp32("cpu"):
            self.assertFalse(found, f"PyTorch {torch.__version__} computes wrongly in bf16:{as_text(found)}")
        else:
            print(f"{precision.why_not('bf16', 'cpu')}:{as_text(found)}")
            self.assertTrue(found)

    def test_is_found_wrong_and_done_without_on_a_cpu_without_avx512(self):
        with without_avx512():
            cases = {case.name: case for case in transformer_cases() + asd_cases()}
            cases = [cases[n] for n in ("linear 192 -> 768", "downsampler", "attention of 448 tokens, masked")]
            self.assertEqual(sorted(wrong(cases, bf16)), ["downsampler", "linear 192 -> 768"])  # weights' gradients
            self.assertFalse(precision.sums_in_fp32("cpu"))
            self.assertFalse(wrong(cases, lambda: precision.autocast("bf16", "cpu")))


class ARecipe(unittest.TestCase):
    def run_two_steps(self, **more):
        """-> whether autocast was on, what was printed"""
        config = {"steps": 2, "learning_rate": 0.1, "warmup": 1, "decay": 0, "ema": 0.9, "clip": 1,
                  "betas": (0.9, 0.99), "precision": "bf16", "device": "cpu", "minutes": 0, "save_minutes": 10,
                  "batch": 4, "accumulate": 1, "recompute": False, "keep": 1, "tensorboard": False, **more}
        seen = []

        def loss(model, step, _):
            seen.append(torch.is_autocast_cpu_enabled())
            return model(torch.ones(4, 8)).float().square().mean(), {}
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()) as said:
            Trainer(folder, nn.Linear(8, 8), config, lambda state: None).run(loss)
        return seen, said.getvalue()

    def test_trains_in_fp32_and_says_so_where_bf16_is_wrong(self):
        with without_avx512():
            seen, said = self.run_two_steps()
            self.assertEqual(seen, [False, False])
            self.assertIn("computing in fp32 in place of bf16", said)
            self.assertNotIn("in place of", self.run_two_steps(precision="fp32")[1])

    def test_trains_in_bf16_where_that_is_right(self):
        if not precision.sums_in_fp32("cpu"):
            self.skipTest(precision.why_not("bf16", "cpu"))
        seen, said = self.run_two_steps()
        self.assertEqual(seen, [True, True])
        self.assertNotIn("in place of", said)

    def test_a_run_without_gradients_takes_none_from_one_after_it(self):
        model = nn.Sequential(nn.Linear(8, 8), nn.Linear(8, 8))
        x = torch.ones(4, 8)
        with precision.autocast("bf16", "cpu"):
            with torch.no_grad():
                x = model(x)
            model(x).float().square().mean().backward()
        self.assertTrue(all(p.grad is not None and p.grad.any() for p in model.parameters()))


if __name__ == "__main__":
    unittest.main()

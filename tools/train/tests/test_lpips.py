# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""LPIPS: that the engine's figure is that of PyTorch in double, by AlexNet and VGG16 in full width with random weights."""
import json
import os
import subprocess
import tempfile
import unittest

import numpy as np
import torch
from PIL import Image

from semtrain import safetensors_file
from semtrain.program import engine_path

SEMROVER = engine_path()
SHIFT = torch.tensor([-.030, -.088, -.188], dtype=torch.float64)[:, None, None]
SCALE = torch.tensor([.458, .448, .450], dtype=torch.float64)[:, None, None]


def alexnet():
    """-> modules as torchvision's alexnet().features has them, those whose outputs are compared"""
    sizes, modules = ((3, 64, 11, 4, 2), (64, 192, 5, 1, 2), (192, 384, 3, 1, 1), (384, 256, 3, 1, 1),
                      (256, 256, 3, 1, 1)), []
    for number, (inputs, outputs, side, stride, padding) in enumerate(sizes):
        modules += [torch.nn.Conv2d(inputs, outputs, side, stride, padding), torch.nn.ReLU()]
        if number < 2:
            modules.append(torch.nn.MaxPool2d(3, 2))
    return torch.nn.Sequential(*modules), (1, 4, 7, 9, 11)


def vgg16():
    """as alexnet(), of vgg16().features"""
    modules, inputs = [], 3
    for outputs in (64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512):
        if outputs:
            modules += [torch.nn.Conv2d(inputs, outputs, 3, 1, 1), torch.nn.ReLU()]
            inputs = outputs
        else:
            modules.append(torch.nn.MaxPool2d(2, 2))
    return torch.nn.Sequential(*modules), (3, 8, 15, 22, 29)


def unit(x):
    return x / (x.square().sum(0).sqrt() + 1e-10)


@unittest.skipUnless(os.access(SEMROVER, os.X_OK), f"{SEMROVER} is not built; $SEMROVER names another")
class TheEngine(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def write_pictures(self, width, height):
        """structure, and the same with noise -> both as [3, H, W], -1..1"""
        random = np.random.default_rng(width)
        y, x = np.mgrid[:height, :width]
        clean = np.stack([128 + 90 * np.sin(x / period) * np.cos(y / (period + 3)) for period in (5, 9, 14)], -1)
        pictures = []
        for name, noise in (("true", 0), ("made", 25)):
            picture = (clean + random.normal(0, 1, clean.shape) * noise).clip(0, 255).astype(np.uint8)
            os.makedirs(self.path(name), exist_ok=True)
            Image.fromarray(picture).save(self.path(f"{name}/{width}.png"))
            pictures.append(torch.from_numpy(picture).double().permute(2, 0, 1) / 127.5 - 1)
        return pictures

    def check(self, backbone, sizes):
        features, ends = backbone()
        draw, tensors, weights = torch.Generator().manual_seed(1), {}, []
        for number, module in enumerate(features):
            if isinstance(module, torch.nn.Conv2d):
                module.weight.data.normal_(0, (2 / module.weight[0].numel()) ** 0.5, generator=draw)
                module.bias.data.normal_(0, 0.1, generator=draw)
                tensors.update({f"features.{number}.{name}": value.data for name, value in module.named_parameters()})
                channels = module.out_channels
            if number in ends:
                weights.append(torch.rand(1, channels, 1, 1, generator=draw))
                tensors[f"lin{len(weights) - 1}.model.1.weight"] = weights[-1]
        safetensors_file.write(self.path("net.safetensors"), tensors)
        features, expected = features.double(), {}
        for width, height in sizes:
            made, true = ((picture - SHIFT) / SCALE for picture in self.write_pictures(width, height))
            figure, number, x = 0, 0, torch.stack([made, true])
            with torch.no_grad():
                for index, module in enumerate(features):
                    x = module(x)
                    if index in ends:
                        difference = (unit(x[0]) - unit(x[1])).square()
                        figure += float((weights[number].double()[0] * difference).sum(0).mean())
                        number += 1
            expected[str(width)] = figure
        done = subprocess.run([SEMROVER, "eval", "frames", self.path("made"), self.path("true"), "--lpips",
                               self.path("net.safetensors"), "--json", "-q"], check=True, stdout=subprocess.PIPE)
        report = json.loads(done.stdout)
        for frame in report["frames"]:
            expect = expected[frame["name"]]
            error = abs(frame["lpips"] - expect) / expect
            print(f"{backbone.__name__}: {frame['name']} wide, {expect:.6f}, relative error {error:.1e}")
            self.assertGreater(expect, 0.01)
            self.assertLess(error, 1e-5)
        self.assertAlmostEqual(report["lpips"], sum(expected.values()) / len(expected), delta=1e-5)

    def test_has_the_figures_of_alexnet(self):
        self.check(alexnet, ((31, 31), (97, 61), (308, 211)))

    def test_has_the_figures_of_vgg16(self):
        self.check(vgg16, ((16, 16), (97, 61), (181, 130)))


if __name__ == "__main__":
    unittest.main()

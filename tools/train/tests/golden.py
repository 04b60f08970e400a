# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The golden cases (tests/golden) as the recipes' tests read them."""
import json
import os

import torch

from semtrain import safetensors_file

FOLDER = os.path.join(os.path.dirname(__file__), "..", "..", "..", "tests", "golden")


class GoldenCase:
    def __init__(self, name, model="model"):
        folder = os.path.join(FOLDER, name)
        with open(os.path.join(folder, "case.json")) as file:
            self.case = json.load(file)
        self.tensors = safetensors_file.read(os.path.join(folder, "tensors.safetensors"))
        with open(os.path.join(folder, model, "config.json")) as file:
            self.config = json.load(file)
        weights = safetensors_file.read(os.path.join(folder, model, "diffusion_pytorch_model.safetensors"))
        self.weights = {name: t.float() for name, t in weights.items()}

    def worst(self, name, got, rows=None):
        """|got - expect| over max(1, max |expect|), as a multiple of the fp32 tolerance"""
        expect = self.tensors[f"expect.{name}"]
        error, scale = (got - expect).abs(), max(1.0, float(expect.abs().max()))
        if rows is not None:
            error = error[rows]
        return float(error.max()) / scale / self.case["tolerance"]["fp32"]


def ints(tensor):
    return tensor.to(torch.int64)

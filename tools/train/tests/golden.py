# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Golden cases of tests/golden: what public reference code gives, with the tolerance of the case."""
import json
import os

from semtrain import model_folder, safetensors_file

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..", "tests", "golden")


def read_case(name):
    """-> (case.json, {name: tensor})"""
    folder = os.path.join(FOLDER, name)
    with open(os.path.join(folder, "case.json")) as file:
        return json.load(file), safetensors_file.read(os.path.join(folder, "tensors.safetensors"))


def load_network(network, case, part=""):
    """the case's network, with its weights: every tensor of the file, and no other"""
    config, state = model_folder.read_component(os.path.join(FOLDER, case, "model", part))
    model = network(config)
    model.load_state_dict({name: t.float() for name, t in state.items()}, strict=True)
    return model.eval()


def apart(result, expected):
    """largest difference, as a share of the expected values' spread"""
    if result.shape != expected.shape:
        raise ValueError(f"the result is {tuple(result.shape)}, expected {tuple(expected.shape)}")
    return float((result - expected).abs().max() / expected.abs().max())

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
import json
import os
import tempfile
import unittest

import torch
from torch import nn
from torch.nn import functional as F

from semtrain import empty_prompt, safetensors_file

LAYERS, WIDTH, WIDER, HEADS, WORDS, PLACES = 3, 24, 40, 4, 50, 11


def write_text_encoder(folder, width=WIDTH, act="quick_gelu", half=False, padding="<|endoftext|>"):
    """text_encoder/ and tokenizer/ as the hub has them, with random weights -> {name without text_model.: fp32}"""
    torch.manual_seed(3)
    shapes = {"embeddings.token_embedding.weight": (WORDS, width), "final_layer_norm.weight": (width,),
              "embeddings.position_embedding.weight": (PLACES, width), "final_layer_norm.bias": (width,)}
    for i in range(LAYERS):
        name = f"encoder.layers.{i}"
        shapes.update({f"{name}.self_attn.{part}_proj.weight": (width, width) for part in ("q", "k", "v", "out")})
        shapes.update({f"{name}.self_attn.{part}_proj.bias": (width,) for part in ("q", "k", "v", "out")})
        shapes.update({f"{name}.layer_norm{n}.{part}": (width,) for n in (1, 2) for part in ("weight", "bias")})
        shapes.update({f"{name}.mlp.fc1.weight": (WIDER, width), f"{name}.mlp.fc1.bias": (WIDER,),
                       f"{name}.mlp.fc2.weight": (width, WIDER), f"{name}.mlp.fc2.bias": (width,)})
    tensors = {name: torch.randn(shape) * 0.3 for name, shape in shapes.items()}
    if half:
        tensors = {name: t.half() for name, t in tensors.items()}
    os.makedirs(os.path.join(folder, "text_encoder"), exist_ok=True)
    os.makedirs(os.path.join(folder, "tokenizer"), exist_ok=True)
    file = "model.fp16.safetensors" if half else "model.safetensors"
    safetensors_file.write(os.path.join(folder, "text_encoder", file),
                           {**{f"text_model.{name}": t for name, t in tensors.items()},
                            "text_model.embeddings.position_ids": torch.arange(PLACES)[None]})
    files = {"text_encoder/config.json": {"num_hidden_layers": LAYERS, "num_attention_heads": HEADS, "hidden_act": act,
                                          "vocab_size": WORDS, "max_position_embeddings": PLACES, "eos_token_id": 2},
             "tokenizer/special_tokens_map.json": {"pad_token": padding},
             "tokenizer/vocab.json": {"!": 0, "<|startoftext|>": WORDS - 2, "<|endoftext|>": WORDS - 1}}
    for name, value in files.items():
        with open(os.path.join(folder, name), "w") as file:
            json.dump(value, file)
    return {name: t.float() for name, t in tensors.items()}


def by_torch(t, act, tokens):
    """PyTorch's own encoder in double"""
    x = (t["embeddings.token_embedding.weight"][tokens] + t["embeddings.position_embedding.weight"])[None].double()
    for i in range(LAYERS):
        of = {name[len(f"encoder.layers.{i}."):]: v for name, v in t.items() if name.startswith(f"encoder.layers.{i}.")}
        layer = nn.TransformerEncoderLayer(x.shape[-1], HEADS, WIDER, 0.0, act, batch_first=True, norm_first=True)
        layer = layer.double()
        attention = [torch.cat([of[f"self_attn.{p}_proj.{kind}"] for p in "qkv"]) for kind in ("weight", "bias")]
        state = {"self_attn.in_proj_weight": attention[0], "self_attn.in_proj_bias": attention[1]}
        for own, theirs in (("self_attn.out_proj", "self_attn.out_proj"), ("mlp.fc1", "linear1"), ("mlp.fc2", "linear2"),
                            ("layer_norm1", "norm1"), ("layer_norm2", "norm2")):
            state.update({f"{theirs}.{kind}": of[f"{own}.{kind}"] for kind in ("weight", "bias")})
        layer.load_state_dict(state)
        x = layer(x, torch.ones(PLACES, PLACES, dtype=torch.bool).triu(1))
    return F.layer_norm(x, x.shape[-1:], t["final_layer_norm.weight"].double(), t["final_layer_norm.bias"].double())


class AnEmptyPrompt(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def test_is_what_pytorchs_own_encoder_makes_of_it(self):
        quick = lambda x: x * torch.sigmoid(1.702 * x)
        cases = (("quick_gelu", quick, False, "<|endoftext|>", WORDS - 1), ("gelu", F.gelu, True, {"content": "!"}, 0))
        for act, function, half, padding, filled in cases:
            with self.subTest(act=act), tempfile.TemporaryDirectory() as folder:
                tensors = write_text_encoder(folder, act=act, half=half, padding=padding)
                found = empty_prompt.embedding_of(folder)
                tokens = torch.tensor([WORDS - 2, WORDS - 1] + [filled] * (PLACES - 2))
                expected = by_torch(tensors, function, tokens).detach()
                self.assertEqual(found.shape, (1, PLACES, WIDTH))
                self.assertLess(float((found - expected).abs().max()), 1e-5)

    def test_of_an_incomplete_encoder_is_refused(self):
        write_text_encoder(self.folder)
        path = os.path.join(self.folder, "text_encoder", "model.safetensors")
        tensors = safetensors_file.read(path)
        del tensors["text_model.encoder.layers.1.mlp.fc2.bias"]
        safetensors_file.write(path, tensors)
        with self.assertRaisesRegex(SystemExit, "there is no 'encoder.layers.1.mlp.fc2.bias'"):
            empty_prompt.embedding_of(self.folder)
        os.remove(path)
        with self.assertRaisesRegex(SystemExit, "expected model.safetensors or model.fp16.safetensors"):
            empty_prompt.embedding_of(self.folder)


if __name__ == "__main__":
    unittest.main()

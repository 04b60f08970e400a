# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What Stable Diffusion's text encoder makes of the empty prompt, the text that its UNet knows best. The encoder is
CLIP's (Radford et al. 2021, arXiv 2103.00020) in the layout of transformers' CLIPTextModel."""
import os

import torch
from torch.nn import functional as F

from . import safetensors_file
from .json_file import read_json
from .nets.attention import attend

FILES = ("model.safetensors", "model.fp16.safetensors")
ACTIVATIONS = {"quick_gelu": lambda x: x * torch.sigmoid(1.702 * x), "gelu": F.gelu}


def has_encoder(folder):
    return os.path.isdir(os.path.join(folder, "text_encoder"))


def tokens_of_nothing(folder, config):
    """-> [1, N]: where the text begins, where it ends, and padding, which the tokenizer names: the end again in Stable
    Diffusion 1, the vocabulary's first word in 2"""
    begin, end = config["vocab_size"] - 2, config["vocab_size"] - 1
    names, words = (os.path.join(folder, "tokenizer", name) for name in ("special_tokens_map.json", "vocab.json"))
    padding = read_json(names).get("pad_token") if os.path.exists(names) else None
    padding = padding["content"] if isinstance(padding, dict) else padding
    padding = read_json(words)[padding] if padding and os.path.exists(words) else end
    return torch.tensor([[begin, end] + [padding] * (config["max_position_embeddings"] - 2)])


def encode(tensors, config, tokens):
    """the hidden states behind the last norm [1, N, width], fp32"""
    def linear(name, x):
        return F.linear(x, tensors[f"{name}.weight"], tensors[f"{name}.bias"])

    def norm(name, x):
        return F.layer_norm(x, x.shape[-1:], tensors[f"{name}.weight"], tensors[f"{name}.bias"],
                            config.get("layer_norm_eps", 1e-5))

    def heads(x):
        return x.unflatten(-1, (config["num_attention_heads"], -1)).transpose(1, 2)
    act, count = ACTIVATIONS[config.get("hidden_act", "quick_gelu")], tokens.shape[1]
    earlier = torch.full((count, count), float("-inf")).triu(1)
    x = tensors["embeddings.token_embedding.weight"][tokens] + tensors["embeddings.position_embedding.weight"][:count]
    for layer in range(config["num_hidden_layers"]):
        name = f"encoder.layers.{layer}"
        y = norm(f"{name}.layer_norm1", x)
        y = attend(*(heads(linear(f"{name}.self_attn.{part}_proj", y)) for part in "qkv"), earlier)
        x = x + linear(f"{name}.self_attn.out_proj", y.transpose(1, 2).flatten(2))
        x = x + linear(f"{name}.mlp.fc2", act(linear(f"{name}.mlp.fc1", norm(f"{name}.layer_norm2", x))))
    return norm("final_layer_norm", x)


@torch.no_grad()
def embedding_of(folder):
    """FOLDER has text_encoder/ and, where padding is not the end of a text, tokenizer/ -> [1, N, width], fp32"""
    encoder = os.path.join(folder, "text_encoder")
    path = next((p for p in (os.path.join(encoder, name) for name in FILES) if os.path.exists(p)), None)
    if not path:
        raise SystemExit(f"{encoder}: expected {' or '.join(FILES)}")
    config = read_json(os.path.join(encoder, "config.json"))
    if config.get("hidden_act", "quick_gelu") not in ACTIVATIONS:
        raise SystemExit(f"{encoder}: hidden_act {config['hidden_act']}, expected {' or '.join(ACTIVATIONS)}")
    tensors = {name.removeprefix("text_model."): t.float() for name, t in safetensors_file.read(path).items()
               if t.is_floating_point()}
    try:
        return encode(tensors, config, tokens_of_nothing(folder, config))
    except KeyError as missing:
        raise SystemExit(f"{encoder}: there is no {missing}; expected transformers' CLIPTextModel") from None

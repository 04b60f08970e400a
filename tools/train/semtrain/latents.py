# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Latents of drives, encoded once by a trained VAE and kept in a folder."""
import os

import torch

from . import model_folder, safetensors_file
from .content import digest, digest_of_pictures
from .denoising import block_shares
from .frames import fill_blocks, to_floats
from .nets.vae import AutoencoderKL
from .nets.video_vae import AutoencoderKLTemporalDecoder


def load_vae(folder):
    """-> AutoencoderKL, or that of videos, as the config says, with the weights of a vae folder, evaluating"""
    config, state = model_folder.read_component(folder)
    of_videos = config.get("_class_name") == "AutoencoderKLTemporalDecoder"
    vae = AutoencoderKLTemporalDecoder(config) if of_videos else AutoencoderKL(config)
    vae.load_state_dict({name: t.float() for name, t in state.items()})
    return vae.eval().requires_grad_(False)


class Sequence:
    """a drive as the denoiser sees it: truth, buffer [F, 4, h, w], visible [F, 1, h, w], first [F]: nothing before"""

    def __init__(self, tensors):
        self.truth, self.buffer, self.visible = (tensors[n].float() for n in ("truth", "buffer", "visible"))
        self.first = tensors["first"].bool().tolist()

    def __len__(self):
        return len(self.first)


@torch.no_grad()
def encode_drive(vae, drive, flip):
    """-> {truth, buffer, visible, first} of a drive, or of its mirror image"""
    rows = {"truth": [], "buffer": [], "visible": []}
    for number in drive.numbers:
        pictures = {"truth": to_floats(drive.truth(number)), "buffer": to_floats(drive.buffer(number)),
                    "visible": drive.visible(number)}
        for name, picture in pictures.items():
            filled = fill_blocks(picture[None], vae.downscale)  # before it is mirrored: blocks begin at the left
            filled = filled.flip(3) if flip else filled
            rows[name].append(block_shares(filled, vae.downscale) if name == "visible" else vae.encode_scaled(filled))
    out = {name: torch.cat(values) for name, values in rows.items()}
    out["first"] = torch.tensor([not drive.has_previous(n) for n in drive.numbers], dtype=torch.uint8)
    return out


def sequences(vae_folder, drives, cache, mirrored=True):
    """-> [Sequence] of the drives, then of their mirror images; what `cache` does not hold yet is encoded"""
    os.makedirs(cache, exist_ok=True)
    vae, out = None, []
    of_vae = digest([os.path.join(vae_folder, "config.json"), model_folder.weights_of(vae_folder)])
    contents = [digest_of_pictures(drive.pictures(drive.numbers), f"{of_vae} {drive.numbers}") for drive in drives]
    for flip in (False, True) if mirrored else (False,):
        for drive, content in zip(drives, contents):
            path = os.path.join(cache, f"{content}{'-mirrored' if flip else ''}.safetensors")
            if not os.path.exists(path):
                vae = vae or load_vae(vae_folder)
                safetensors_file.write(path, encode_drive(vae, drive, flip), {"drive": drive.folder, "flip": flip})
            out.append(Sequence(safetensors_file.read(path)))
    return out

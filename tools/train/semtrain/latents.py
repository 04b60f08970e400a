# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Latents of drives, encoded once by a trained VAE, and kept in a folder in files of up to FRAMES frames: what a kill
costs, and what one of several processes encodes at a time. They are mapped to memory, not read into it."""
import os
from concurrent.futures import ThreadPoolExecutor
from itertools import islice

import torch

from . import model_folder, processes, safetensors_file
from .content import digest, digest_of_pictures
from .denoising import block_shares
from .draws import number_below
from .frames import fill_blocks, to_floats
from .nets.vae import AutoencoderKL
from .nets.video_vae import AutoencoderKLTemporalDecoder

FRAMES = 64  # of a file: 9 MB of 616 x 424


def load_vae(folder):
    """-> AutoencoderKL, or that of videos, as the config says, with the weights of a vae folder, evaluating"""
    config, state = model_folder.read_component(folder)
    of_videos = config.get("_class_name") == "AutoencoderKLTemporalDecoder"
    vae = AutoencoderKLTemporalDecoder(config) if of_videos else AutoencoderKL(config)
    vae.load_state_dict({name: t.float() for name, t in state.items()})
    return vae.eval().requires_grad_(False)


class Joined:
    """tensors [FRAMES, ...], of which the last may be shorter, as one [F, ...]. Frames are copied when they are asked
    for, by number or by a range [i:j], as fp32"""

    def __init__(self, tensors):
        self.tensors = tensors
        self.shape = (sum(map(len, tensors)), *tensors[0].shape[1:])

    def __getitem__(self, which):
        if isinstance(which, slice):
            return torch.stack([self[i] for i in range(*which.indices(self.shape[0]))])
        return self.tensors[which // FRAMES][which % FRAMES].float()


class Sequence:
    """a drive as the denoiser sees it: truth, buffer [F, 4, h, w], visible [F, 1, h, w], first [F]: nothing before; used
    [F, 1, h, w], 1 where all pixels of a block are trained on, or None: everywhere"""

    def __init__(self, files, first):
        """files: {name: tensor} of FRAMES frames each, the last one of what is left"""
        self.truth, self.buffer, self.visible = (Joined([f[n] for f in files]) for n in ("truth", "buffer", "visible"))
        self.first, self.used = first, None
        if any("used" in f for f in files):
            self.used = Joined([f["used"] if "used" in f else torch.ones_like(f["visible"]) for f in files])

    def __len__(self):
        return len(self.first)


def used_of(sequence, which):
    """`used` of a frame or of a range of them"""
    return torch.ones_like(sequence.visible[which]) if sequence.used is None else sequence.used[which]


def crop_of(config, all_sequences):
    """height and width of what a step trains on: config's, or less where a drive's latents are smaller"""
    return tuple(min(most, *(s.truth.shape[axis] for s in all_sequences)) for axis, most in zip((2, 3), config["crop"]))


def crop_place(sequence, crop, draw):
    """an index that cuts a crop of this height and width from latents [..., H, W], somewhere"""
    top, left = (number_below(size - most + 1, draw) for size, most in zip(sequence.truth.shape[2:], crop))
    return (..., slice(top, top + crop[0]), slice(left, left + crop[1]))


class Encoder:
    """of a vae folder, which is loaded when it is first needed; random numbers stay as they were"""

    def __init__(self, folder, device, batch):
        self.folder, self.device, self.batch, self.vae = folder, device, batch, None

    @torch.no_grad()
    def encode(self, drive, numbers, flip):
        """-> {truth, buffer, visible, and used where a frame has it} of frames of a drive, or of their mirror images"""
        if not self.vae:
            with torch.random.fork_rng(devices=[]):
                self.vae = load_vae(self.folder).to(self.device)
        rows, masked = {"truth": [], "buffer": [], "visible": []}, any(n in drive.of_used for n in numbers)
        if masked:
            rows["used"] = []

        def read(n):
            frame = drive.used_truth(n), drive.buffer(n), drive.visible(n)
            return (*frame, drive.used(n) if n in drive.of_used else torch.ones_like(frame[2])) if masked else frame

        with ThreadPoolExecutor(4) as pool:  # reads while the device encodes
            frames = pool.map(read, numbers)
            for _ in range(0, len(numbers), self.batch):
                batch = [torch.stack(part) for part in zip(*islice(frames, self.batch))]
                for name, pictures in zip(rows, batch):
                    rows[name].append(self._encode(name, pictures.to(self.device), flip).cpu())
        return {name: torch.cat(values) for name, values in rows.items()}

    def _encode(self, name, pictures, flip):
        mask = name in ("visible", "used")
        pictures = pictures if mask else to_floats(pictures)
        filled = fill_blocks(pictures, self.vae.downscale)  # before it is mirrored: blocks begin at the left
        filled = filled.flip(3) if flip else filled
        if not mask:
            return self.vae.encode_scaled(filled)
        shares = block_shares(filled, self.vae.downscale)
        return shares if name == "visible" else (shares == 1).float()


def sequences(vae_folder, drives, cache, config, mirrored=True):
    """-> [Sequence] of the drives, then of their mirror images. What `cache` does not hold yet is encoded on config's
    device, `encode_batch` frames at a time, by all processes, which all call this"""
    os.makedirs(cache, exist_ok=True)
    of_vae = digest([os.path.join(vae_folder, "config.json"), model_folder.weights_of(vae_folder)])
    encoder = Encoder(vae_folder, config["device"], config["encode_batch"])
    parts = [(drive, drive.numbers[i:i + FRAMES]) for drive in drives for i in range(0, len(drive.numbers), FRAMES)]

    def encoded(part):
        drive, numbers, flips = *part, (False, True) if mirrored else (False,)
        content = digest_of_pictures(drive.pictures(numbers), f"{of_vae} {numbers}")
        paths = [os.path.join(cache, f"{content}{'-mirrored' if flip else ''}.safetensors") for flip in flips]
        for path, flip in zip(paths, flips):
            if not os.path.exists(path):
                print(f"encoding {drive.folder} from frame {numbers[0]}{', mirrored' if flip else ''}", flush=True)
                tensors = encoder.encode(drive, numbers, flip)
                own = f"{path}.{processes.rank()}"  # the same pictures may be there twice, and be two processes'
                safetensors_file.write(own, tensors, {"drive": drive.folder, "flip": flip})
                os.replace(own, path)
        return paths

    files = processes.divided(encoded, parts)
    out = []
    for flipped in zip(*files):
        left = iter(flipped)
        for drive in drives:
            count = -(-len(drive.numbers) // FRAMES)
            out.append(Sequence([safetensors_file.read(next(left), mapped=True) for _ in range(count)],
                                [not drive.has_previous(n) for n in drive.numbers]))
    return out

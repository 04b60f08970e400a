# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The renderer VSD: a UNet of Stable Video Diffusion that draws windows of frames over their splat buffers
(docs/method.md §6.3).

Its input is the noisy latents, the buffers' latents, which are not scaled, and the visibility; it predicts the velocity
over noise of any strength. The paper fine-tunes Stable Video Diffusion with windows of 12 frames and drops the
visibility in 30 %, for guidance: --config paper --init FOLDER.
"""
import os
import shutil

import torch
from torch import nn

from . import model_folder, safetensors_file, settings
from .denoising import mean_of_used
from .draws import draws, generator, number_below
from .frames import find_drives, splats_of, to_pixels, write_beside
from .latents import crop_of, crop_place, load_vae, sequences, used_of
from .nets.video_unet import UNetSpatioTemporalConditionModel
from .trainer import Trainer
from .video_denoising import (SCHEDULER, denoise_window, timestep_of, velocity_target, video_input, window_denoiser)

INDEX = {"renderer": ["diffusers", "UNetSpatioTemporalConditionModel"], "scheduler": ["diffusers", SCHEDULER["_class_name"]]}


class Renderer(nn.Module):
    """the UNet, and the text that stands for every frame [1, text_tokens, cross_attention_dim]"""

    def __init__(self, config):
        super().__init__()
        self.unet = UNetSpatioTemporalConditionModel(config)
        width = self.unet.config["cross_attention_dim"]
        self.text = nn.Parameter(torch.zeros(1, config["text_tokens"], width), requires_grad=config["train_text"])
        self.added = config["defaults"]["added_time_ids"]

    def numbers(self):
        return torch.tensor([self.added], dtype=torch.float32, device=self.text.device)

    def forward(self, x, buffer, visible, sigma):
        """[B, F, 4, h, w] twice, [B, F, 1, h, w], [B] -> [B, F, 4, h, w]"""
        seen = torch.stack([video_input(*frames) for frames in zip(x, buffer, visible, sigma)])
        return self.unet(seen, timestep_of(sigma), self.text, self.numbers())


def unscaled(latents, vae_config):
    """latents as a denoiser of images sees them -> as the VAE gives them, which is what the network sees of a buffer"""
    return latents / vae_config["scaling_factor"] + (vae_config.get("shift_factor") or 0)


class Batches:
    """what a step trains on: crops of windows of consecutive frames"""

    def __init__(self, all_sequences, config, vae_config):
        self.config, self.vae_config, self.frames = config, vae_config, config["num_frames"]
        self.starts = [(s, i) for s in all_sequences for i in range(len(s) - self.frames + 1)
                       if not any(s.first[i + 1:i + self.frames])]
        if not self.starts:
            raise SystemExit(f"no drive has {self.frames} frames in a row; --set num_frames=N takes shorter windows")
        self.crop, self.masked = crop_of(config, all_sequences), any(s.used is not None for s in all_sequences)

    def make(self, step, part=None):
        """-> truth, buffer [B, F, 4, h, w], visible, and used where a sequence has it [B, F, 1, h, w]; of `part` alone, a
        range of the batch"""
        draw, rows = generator(self.config, step), []
        for _ in range(self.config["batch"]):
            sequence, i = self.starts[number_below(len(self.starts), draw)]
            rows.append(self._window(sequence, i, draw))
        rows = rows if part is None else rows[part.start:part.stop]
        return [torch.stack(parts).to(self.config["device"]) for parts in zip(*rows)]

    def _window(self, s, i, draw):
        place = crop_place(s, self.crop, draw)
        truth, buffer, visible = (of[i:i + self.frames][place] for of in (s.truth, s.buffer, s.visible))
        if float(torch.rand(1, generator=draw)) < self.config["dropout"]:
            visible = torch.zeros_like(visible)
        window = truth, unscaled(buffer, self.vae_config), visible
        return (*window, used_of(s, slice(i, i + self.frames))[place]) if self.masked else window


def step_loss(model, batch, config, random):
    """random: Draws; log sigma is normal -> loss, {low: the error of the velocity at sigma below 1}"""
    truth, buffer, visible, *used = batch
    sigma = torch.exp(config["sigma_mean"] + config["sigma_deviation"] * random.normal())
    sigma = sigma.clamp(SCHEDULER["sigma_min"], SCHEDULER["sigma_max"]).to(truth.device)
    noise = random.normal(truth.shape[1:]).to(truth.device)
    level = sigma.view(-1, 1, 1, 1, 1)
    made = model(truth + level * noise, buffer, visible, sigma).float()
    error = mean_of_used((made - velocity_target(truth, noise, level)).square(), *used or [None])
    low = error[sigma < 1]
    return error.mean(), {"low": float(low.mean() if len(low) else error.mean())}


def loss_of(batches, config):
    return lambda model, step, part: step_loss(model, batches.make(step, part), config, draws(config, step, 1, part))


class Export:
    """writes OUT as a model folder that `semrover refine -m` loads, and one held-out window as it draws it"""

    def __init__(self, folder, config, vae_folder, held):
        self.folder, self.config, self.vae_folder, self.held = folder, config, vae_folder, held

    @torch.no_grad()
    def __call__(self, state):
        unet = {name[5:]: t for name, t in state.items() if name.startswith("unet.")}
        model = Renderer(self.config).eval()
        model.load_state_dict(state)
        vae_class = model_folder.read_component(self.vae_folder)[0].get("_class_name", "AutoencoderKL")
        model_folder.write_component(os.path.join(self.folder, "renderer"), model.unet.config_json(), unet,
                                     self.config["mantissa_bits"])
        os.makedirs(os.path.join(self.folder, "conditioning"), exist_ok=True)
        safetensors_file.write(os.path.join(self.folder, "conditioning", "conditioning.safetensors"),
                               {"encoder_hidden_states": state["text"].half()})
        model_folder.write_scheduler(os.path.join(self.folder, "scheduler"), SCHEDULER)
        shutil.copytree(self.vae_folder, os.path.join(self.folder, "vae"), dirs_exist_ok=True)
        model_folder.add_to_index(self.folder, {**INDEX, "vae": ["diffusers", vae_class]},
                                  {"renderer": self.config["defaults"]})
        if self.held:
            self._draw(model)

    def _draw(self, model):
        """buffer | drawn | truth, of the first and the last frame of a window"""
        s, drive = self.held
        count, device, d = min(self.config["num_frames"], len(s)), self.config["device"], self.config["defaults"]
        model, vae = model.to(device), load_vae(self.vae_folder).to(device)
        noise = torch.randn(s.truth[:count].shape, generator=torch.Generator().manual_seed(1)).to(device)
        clean = window_denoiser(model.unet, model.text, model.numbers(),
                                unscaled(s.buffer[:count], vae.config).to(device), s.visible[:count].to(device),
                                d["first_guidance_scale"], d["guidance_scale"])
        pictures = to_pixels(vae.decode_scaled(denoise_window(clean, noise, d["num_inference_steps"]))).cpu()
        for i in (0, count - 1):
            number = drive.numbers[i]
            truth = drive.truth(number)
            made = pictures[i, :, :truth.shape[1], :truth.shape[2]]
            write_beside(os.path.join(self.folder, f"held_out_{i}.png"), [drive.buffer(number), made, truth])


def read_init(folder, config):
    """weights of a renderer of videos, or of a plain Stable Video Diffusion folder, whose UNet keeps the image's
    channels for the buffer and gets one more with zeros (as `semrover convert --vsd-init` does) -> state of a Renderer;
    the UNet's shape goes to config"""
    part = "renderer" if os.path.isdir(os.path.join(folder, "renderer")) else "unet"
    of_init, state = model_folder.read_component(os.path.join(folder, part))
    frames = config["num_frames"]
    config.update({k: v for k, v in UNetSpatioTemporalConditionModel(of_init).config.items() if k in of_init})
    conv = state["conv_in.weight"].float()
    config["in_channels"], config["num_frames"] = 2 * config["out_channels"] + 1, frames
    more = conv.new_zeros(conv.shape[0], config["in_channels"] - conv.shape[1], *conv.shape[2:])
    out = {f"unet.{name}": t for name, t in state.items()}
    out["unet.conv_in.weight"] = torch.cat([conv, more], 1)
    path = os.path.join(folder, "conditioning", "conditioning.safetensors")
    if os.path.exists(path):
        out["text"] = safetensors_file.read(path)["encoder_hidden_states"].float()
        config["text_tokens"] = out["text"].shape[1]
    else:
        out["text"] = torch.zeros(1, config["text_tokens"], config["cross_attention_dim"])
    return out


def main(arguments=None):
    p = settings.parser("vsd", __doc__.splitlines()[0])
    p.add_argument("--frames", required=True, help="folder of drives (see semtrain/frames.py)")
    p.add_argument("--vae", help="folder of the VAE, of images or of videos; it stays as it is; default: INIT/vae")
    p.add_argument("--held-out", help="folder of drives; each checkpoint logs their loss, and draws of the first")
    p.add_argument("--init", help="model folder to start from: a renderer of videos, or Stable Video Diffusion")
    p.add_argument("--cache", help="folder for the frames' latents; default: OUT/latents")
    options = p.parse_args(arguments)
    options.vae = options.vae or model_folder.vae_of(options.init)
    config = settings.resolve("vsd", options)
    state = read_init(options.init, config) if options.init else None
    cache = options.cache or os.path.join(options.output, "latents")
    torch.manual_seed(config["seed"])
    drives = find_drives(options.frames)
    config["defaults"] = splats_of(drives, config["defaults"])
    held, vae_config = find_drives(options.held_out) if options.held_out else [], load_vae(options.vae).config
    batches = Batches(sequences(options.vae, drives, cache, config, config["mirror"]), config, vae_config)
    held_out = sequences(options.vae, held, cache, config, mirrored=False)
    print(f"{len(batches.starts)} windows of {batches.frames} frames, mirror images counted", flush=True)
    trainer = Trainer(options.output, Renderer(config), config, Export(options.output, config, options.vae,
                                                                       (held_out[0], held[0]) if held else None))
    if state:
        trainer.start_from(state)
    trainer.run(loss_of(batches, config), loss_of(Batches(held_out, config, vae_config), config) if held else None)


if __name__ == "__main__":
    main()

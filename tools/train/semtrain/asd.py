# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The renderer ASD: a Stable Diffusion UNet that draws a frame over its splat buffer (docs/method.md §6.1).

Its input is the noisy latent, the previous frame's latent with noise on it, the buffer's latent and the visibility; it
predicts the noise (or the velocity, in the small config: with few steps trained, noise predicted at high levels says little
about the picture). The paper fine-tunes Stable Diffusion 1.5: --config paper --init FOLDER.
"""
import os
import shutil

import torch
from torch import nn

from . import empty_prompt, model_folder, safetensors_file, settings
from .denoising import alphas_cumprod, ddim_timesteps, denoise, input_of, mean_of_used, noise_of, scheduler_of
from .draws import draws, generator, number_below, timesteps_at
from .frames import find_drives, splats_of, to_pixels, write_beside
from .latents import crop_of, crop_place, load_vae, sequences, used_of
from .nets.unet import UNet2DConditionModel
from .trainer import Trainer

INDEX = {"renderer": ["diffusers", "UNet2DConditionModel"], "vae": ["diffusers", "AutoencoderKL"],
         "scheduler": ["diffusers", "DDIMScheduler"]}


class Renderer(nn.Module):
    """the UNet, and the text that stands for every frame [1, text_tokens, cross_attention_dim]"""

    def __init__(self, config):
        super().__init__()
        self.unet = UNet2DConditionModel(config)
        width = self.unet.config["cross_attention_dim"]
        self.text = nn.Parameter(torch.zeros(1, config["text_tokens"], width), requires_grad=config["train_text"])

    def forward(self, noisy, previous, buffer, visible, timestep):
        return self.unet(input_of(noisy, previous, buffer, visible), timestep, self.text)


class Batches:
    """what a step trains on: crops of latents, each from a frame of its own"""

    def __init__(self, all_sequences, config):
        self.config = config
        self.frames = [(s, i) for s in all_sequences for i in range(len(s))]
        self.crop, self.masked = crop_of(config, all_sequences), any(s.used is not None for s in all_sequences)

    def make(self, step, part=None):
        """-> truth, previous (with noise on it, or zeros), buffer [B, 4, h, w], visible, and used where a sequence has it
        [B, 1, h, w]; of `part` alone, a range of the batch"""
        draw, rows = generator(self.config, step), []
        for _ in range(self.config["batch"]):
            sequence, i = self.frames[number_below(len(self.frames), draw)]
            rows.append(self._frame(sequence, i, draw))
        rows = rows if part is None else rows[part.start:part.stop]
        return [torch.stack(parts).to(self.config["device"]) for parts in zip(*rows)]

    def _frame(self, s, i, draw):
        place = crop_place(s, self.crop, draw)
        low, high = self.config["previous_noise"]
        chance, scale = torch.rand(2, generator=draw).tolist()
        noise = torch.randn(s.truth[0][place].shape, generator=draw)
        previous, visible = torch.zeros_like(noise), s.visible[i][place]
        if chance < self.config["dropout"]:
            visible = torch.zeros_like(visible)
        elif chance >= self.config["dropout"] + self.config["first_share"] and not s.first[i]:
            previous = s.truth[i - 1][place] + (low + (high - low) * scale) * noise
        frame = s.truth[i][place], previous, s.buffer[i][place], visible
        return (*frame, used_of(s, i)[place]) if self.masked else frame


def draw_timesteps(n, config, draw):
    """[n]: spread evenly over the batch, raised to timestep_power of their range: below 1, few are near 0, which change
    nothing that one can see. sampler_share of them are instead of those where samplers of few_steps steps look: a small
    network has none to waste on others"""
    spread = (torch.arange(n) + torch.rand(1, generator=draw)) / n
    t = timesteps_at(spread, 1000, config["timestep_power"])
    samplers = [ddim_timesteps(steps, config["timestep_spacing"]) for steps in config["few_steps"]]
    for i in range(n):
        if samplers and float(torch.rand(1, generator=draw)) < config["sampler_share"]:
            of_one = samplers[number_below(len(samplers), draw)]
            t[i] = of_one[number_below(len(of_one), draw)]
    return t


def step_loss(model, batch, alphas, config, random):
    """random: Draws -> loss, {eps: the plain error of the noise}"""
    truth, previous, buffer, visible, *used = batch
    t = random.of_part(draw_timesteps(random.batch, config, random.random))
    noise = random.normal(truth.shape[1:]).to(truth.device)
    a = alphas[t].view(-1, 1, 1, 1).to(truth.device)
    noisy = a.sqrt() * truth + (1 - a).sqrt() * noise
    made = model(noisy, previous, buffer, visible, t.to(truth.device)).float()
    squares = (noise_of(made, noisy, a, config["prediction_type"]) - noise).square()
    error = mean_of_used(squares, *used or [None])
    weight = 1 / a.flatten() if config["weighting"] == "v" else torch.ones_like(error)
    return (weight * error).mean(), {"eps": float(error.mean())}


def loss_of(batches, config):
    alphas = alphas_cumprod()
    return lambda model, step, part: step_loss(model, batches.make(step, part), alphas, config,
                                               draws(config, step, 1, part))


class Export:
    """writes OUT as a model folder that `semrover refine -m` loads, and one held-out frame as it draws it"""

    def __init__(self, folder, config, vae_folder, held):
        self.folder, self.config, self.vae_folder, self.held = folder, config, vae_folder, held

    @torch.no_grad()
    def __call__(self, state):
        unet = {name[5:]: t for name, t in state.items() if name.startswith("unet.")}
        model = Renderer(self.config).eval()
        model.load_state_dict(state)
        model_folder.write_component(os.path.join(self.folder, "renderer"), model.unet.config_json(), unet,
                                     self.config["mantissa_bits"])
        os.makedirs(os.path.join(self.folder, "conditioning"), exist_ok=True)
        safetensors_file.write(os.path.join(self.folder, "conditioning", "conditioning.safetensors"),
                               {"encoder_hidden_states": state["text"].half()})
        model_folder.write_scheduler(os.path.join(self.folder, "scheduler"), scheduler_of(self.config))
        shutil.copytree(self.vae_folder, os.path.join(self.folder, "vae"), dirs_exist_ok=True)
        model_folder.add_to_index(self.folder, INDEX, {"renderer": self.config["defaults"]})
        if self.held:
            self._draw(model)

    def _draw(self, model):
        """buffer | drawn as a first frame | truth"""
        s, drive = self.held
        i, device = len(s) // 2, self.config["device"]
        model, vae = model.to(device), load_vae(self.vae_folder).to(device)
        noise = torch.randn(s.truth[i:i + 1].shape, generator=torch.Generator().manual_seed(1)).to(device)
        steps, scale = self.config["defaults"]["num_inference_steps"], self.config["defaults"]["guidance_scale"]
        made = denoise(model.unet, model.text, noise, torch.zeros_like(noise), s.buffer[i:i + 1].to(device),
                       s.visible[i:i + 1].to(device), steps, scale, scheduler_of(self.config))
        truth = drive.truth(drive.numbers[i])
        picture = to_pixels(vae.decode_scaled(made)).cpu()[0, :, :truth.shape[1], :truth.shape[2]]
        write_beside(os.path.join(self.folder, "held_out.png"), [drive.buffer(drive.numbers[i]), picture, truth])


def read_init(folder, config):
    """weights of a renderer, or of a plain Stable Diffusion 1.5 folder, whose UNet gets the new channels with zeros
    (as `semrover convert --asd-init` does) -> state of a Renderer; the UNet's shape goes to config"""
    part = "renderer" if os.path.isdir(os.path.join(folder, "renderer")) else "unet"
    of_init, state = model_folder.read_component(os.path.join(folder, part))
    config.update({k: v for k, v in UNet2DConditionModel(of_init).config.items() if k in of_init})
    conv = state["conv_in.weight"].float()
    config["in_channels"] = 3 * config["out_channels"] + 1
    more = conv.new_zeros(conv.shape[0], config["in_channels"] - conv.shape[1], *conv.shape[2:])
    out = {f"unet.{name}": t for name, t in state.items()}
    out["unet.conv_in.weight"] = torch.cat([conv, more], 1)
    path = os.path.join(folder, "conditioning", "conditioning.safetensors")
    if os.path.exists(path):
        out["text"] = safetensors_file.read(path)["encoder_hidden_states"].float()
    elif empty_prompt.has_encoder(folder):
        out["text"] = empty_prompt.embedding_of(folder)
    else:
        out["text"] = torch.zeros(1, config["text_tokens"], config["cross_attention_dim"])
    config["text_tokens"], width = out["text"].shape[1:]
    if width != config["cross_attention_dim"]:
        raise SystemExit(f"{folder}: the text has {width} channels, the UNet expects {config['cross_attention_dim']}")
    return out


def main(arguments=None):
    p = settings.parser("asd", __doc__.splitlines()[0])
    p.add_argument("--frames", required=True, help="folder of drives (see semtrain/frames.py)")
    p.add_argument("--vae", help="folder of the VAE (config.json, safetensors); it stays as it is; default: INIT/vae")
    p.add_argument("--held-out", help="folder of drives; each checkpoint logs their loss, and draws of the first")
    p.add_argument("--init", help="model folder to start from: a renderer, or Stable Diffusion 1.5")
    p.add_argument("--cache", help="folder for the frames' latents; default: OUT/latents")
    options = p.parse_args(arguments)
    options.vae = options.vae or model_folder.vae_of(options.init)
    config = settings.resolve("asd", options)
    state = read_init(options.init, config) if options.init else None
    cache = options.cache or os.path.join(options.output, "latents")
    torch.manual_seed(config["seed"])
    drives = find_drives(options.frames)
    config["defaults"] = splats_of(drives, config["defaults"])
    held = find_drives(options.held_out) if options.held_out else []
    batches = Batches(sequences(options.vae, drives, cache, config, config["mirror"]), config)
    held_out = sequences(options.vae, held, cache, config, mirrored=False)
    print(f"{len(batches.frames)} frames, mirror images counted", flush=True)
    model = Renderer(config).to(memory_format=torch.channels_last)
    trainer = Trainer(options.output, model, config, Export(options.output, config, options.vae,
                                                            (held_out[0], held[0]) if held else None))
    if state:
        trainer.start_from(state)
    trainer.run(loss_of(batches, config), loss_of(Batches(held_out, config), config) if held else None)


if __name__ == "__main__":
    main()

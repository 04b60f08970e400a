# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The VAE of the renderer: blocks of pixels <-> latents of 4 channels (docs/method.md §6.1, docs/models.md §5). As many
levels as `block_out_channels` has: four make blocks of 8x8, as the paper's. The small config has three, 4x4, which learn
sooner: 27.4 dB on held-out frames after 3000 steps; 8x8 had 22.3 dB, nearly without colour, after some 1500.

The paper takes that of Stable Diffusion 1.5 as it is. This recipe trains a small one on shaded frames and splat buffers
of streets: L1 of the picture, of a Laplacian pyramid and of colours, and a little KL, on random crops. With --init and
"train": "decoder" the encoder stays as it is, and with it every latent: the decoder may go on learning while a renderer
trains on the latents.
"""
import json
import os

import torch
from torch.nn import functional as F

from . import model_folder, settings
from .draws import draws, generator, number_below
from .frames import fill_blocks, find_drives, psnr, to_floats, to_pixels, write_beside
from .nets.vae import AutoencoderKL
from .trainer import Trainer

LIBRARY = {"vae": ["diffusers", "AutoencoderKL"]}


class Pictures:
    """all truths and buffers of some drives, in memory"""

    def __init__(self, drives):
        self.truths = [drive.truth(n) for drive in drives for n in drive.numbers]
        self.buffers = [drive.buffer(n) for drive in drives for n in drive.numbers]

    def crops(self, config, step, part=None):
        """-> [batch, 3, crop, crop], -1..1; the first round(buffer_share batch) are of buffers. Of `part` alone, a
        range of the batch"""
        draw = generator(config, step)
        size, out = config["crop"], []
        for i in range(config["batch"]):
            of_buffers = i < round(config["buffer_share"] * config["batch"])
            picture = _pick(self.buffers if of_buffers else self.truths, draw)
            if min(picture.shape[1:]) < size:
                raise SystemExit(f"a picture is {picture.shape[2]} x {picture.shape[1]}, smaller than crop {size}")
            top = number_below(picture.shape[1] - size + 1, draw)
            left = number_below(picture.shape[2] - size + 1, draw)
            crop = picture[:, top:top + size, left:left + size]
            crop = crop.flip(2) if number_below(2, draw) else crop
            if part is None or i in part:
                out.append(crop)
        return to_floats(torch.stack(out)).contiguous(memory_format=torch.channels_last)


def laplacian_loss(a, b, levels):
    """mean over levels of the L1 distance of band-passed pictures; [B, 3, H, W]"""
    d, total = a - b, 0.0  # the pyramid is linear: of the difference
    for _ in range(levels):
        small = F.avg_pool2d(d, 2)
        total = total + (d - F.interpolate(small, scale_factor=2, mode="bilinear", align_corners=False)).abs().mean()
        d = small
    return total / levels


def color_loss(a, b, block=4):
    """L1 distance of colours without their grey, in means of 4 x 4 pixels: else a small VAE spends all on brightness"""
    d = F.avg_pool2d(a - b, block)
    return (d - d.mean(1, keepdim=True)).abs().mean()


def step_loss(model, image, config, noise):
    """-> loss, {rec, kl}; noise [B, 4, h, w]: of the posterior's sample, and latent_noise of the latents' deviation"""
    with torch.set_grad_enabled(config["train"] == "both"):
        mean, logvar = (m.float() for m in model.moments(image))
    more = config["latent_noise"] / model.config["scaling_factor"]
    made = model.decode(mean + (logvar.exp() + more ** 2).sqrt() * noise).float()
    rec = (made - image).abs().mean()
    detail = laplacian_loss(made, image, 3)
    kl = 0.5 * (mean.square() + logvar.exp() - 1 - logvar).mean()
    color = color_loss(made, image)
    loss = rec + config["detail_weight"] * detail + config["color_weight"] * color + config["kl_weight"] * kl
    return loss, {"rec": float(rec), "color": float(color), "kl": float(kl)}


def loss_of(pictures, config):
    def loss(model, step, part=None):
        image = pictures.crops(config, step, part).to(config["device"])
        side = config["crop"] // model.downscale
        noise = draws(config, step, 1, part).normal((config["latent_channels"], side, side))
        return step_loss(model, image, config, noise.to(config["device"]))
    return loss


def normalize(model, drives):
    """scaling_factor and shift_factor such that the latents of truths have mean 0 and standard deviation 1"""
    some = drives[::max(1, len(drives) // 12)]
    values = torch.cat([model.moments(_filled(d.truth(d.numbers[0]), model))[0].flatten() for d in some])
    model.config["shift_factor"] = round(float(values.mean()), 6)
    model.config["scaling_factor"] = round(1 / float(values.std()), 6)


def measure(model, drives, picture):
    """PSNR of truths that the VAE encodes and decodes, dB; one of them beside its copy as a picture"""
    values = []
    for drive in drives:
        truth = drive.truth(drive.numbers[len(drive.numbers) // 2])
        made = to_pixels(model.decode(model.moments(_filled(truth, model))[0])[0, :, :truth.shape[1], :truth.shape[2]])
        made = made.cpu()
        values.append(psnr(truth, made))
        if len(values) == 1:
            write_beside(picture, [truth, made])
    return sum(values) / len(values)


def freeze_encoder(model, state):
    """-> the weights, {name: tensor}, that must stay as they are"""
    if state is None:
        raise SystemExit('"train": "decoder" needs --init VAE: its encoder and scaling_factor are kept')
    for part in (model.encoder, model.quant_conv):
        part.requires_grad_(False)
    return {name: t.float() for name, t in state.items() if name.startswith(("encoder.", "quant_conv."))}


class Export:
    """writes OUT/vae from averaged weights, and what held-out drives say of them"""

    def __init__(self, folder, config, drives, held, frozen):
        self.folder, self.config, self.drives, self.held, self.frozen = folder, config, drives, held, frozen

    @torch.no_grad()
    def __call__(self, state):
        model = AutoencoderKL(self.config).eval()
        state = {**state, **self.frozen}
        model.load_state_dict(state)
        model.to(self.config["device"])
        if not self.frozen:
            normalize(model, self.drives)
        model_folder.write_component(os.path.join(self.folder, "vae"), model.config_json(), state,
                                     self.config["mantissa_bits"])
        model_folder.add_to_index(self.folder, LIBRARY)
        if self.held:
            value = measure(model, self.held, os.path.join(self.folder, "held_out.png"))
            print(f"held-out PSNR {value:.2f} dB", flush=True)
            with open(os.path.join(self.folder, "held_out.jsonl"), "a") as file:
                file.write(json.dumps({"psnr": value, "scaling_factor": model.config["scaling_factor"]}) + "\n")


def _filled(picture, model):
    """on the device of the model"""
    picture = picture.to(next(model.parameters()).device)
    return fill_blocks(to_floats(picture)[None], model.downscale)


def _pick(values, draw):
    return values[number_below(len(values), draw)]


def main(arguments=None):
    p = settings.parser("vae", __doc__.splitlines()[0])
    p.add_argument("--frames", required=True, help="folder of drives (see semtrain/frames.py)")
    p.add_argument("--held-out", help="the same, only measured")
    p.add_argument("--init", help="vae folder (config.json, safetensors) to start from; its shape is taken over")
    options = p.parse_args(arguments)
    config = settings.resolve("vae", options)
    state = None
    if options.init:
        of_init, state = model_folder.read_component(options.init)
        config.update({name: of_init[name] for name in AutoencoderKL(of_init).config if name in of_init})
    torch.manual_seed(config["seed"])
    drives = find_drives(options.frames)
    held = find_drives(options.held_out)[:8] if options.held_out else []
    pictures = Pictures(drives)
    print(f"{len(pictures.truths)} frames of {len(drives)} drives", flush=True)
    model = AutoencoderKL(config).to(memory_format=torch.channels_last)
    frozen = freeze_encoder(model, state) if config["train"] == "decoder" else {}
    trainer = Trainer(options.output, model, config, Export(options.output, config, drives, held, frozen))
    if state:
        trainer.start_from(state)

    trainer.run(loss_of(pictures, config), loss_of(Pictures(held), config) if held else None)


if __name__ == "__main__":
    main()

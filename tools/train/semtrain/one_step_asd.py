# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Trains a renderer ASD that draws in one step. Regression alone would draw the mean of all that a splat buffer leaves
open, which is blurred; a discriminator of patches that sees the buffer, too, wants what could be true (pix2pixHD: Wang et
al. 2018, arXiv 1711.11585; of a diffusion model in one step: Sauer et al. 2023, arXiv 2311.17042). A part of the previous
frames is what the renderer itself draws, as in a run."""
import os

import torch

from . import model_folder, settings
from .asd import Export, Renderer, read_init
from .denoising import denoise, mean_of_used, scheduler_of
from .draws import draws, generator, number_below
from .frames import find_drives
from .json_file import read_json
from .latents import crop_of, crop_place, sequences, used_of
from .nets.discriminator import PatchDiscriminator
from .trainer import Trainer

DISCRIMINATOR = "discriminator."  # begins the names of its weights


class OneStep(Renderer):
    """a renderer, and what tells its latents from true ones; both see a frame's buffer and visibility"""

    def __init__(self, config):
        super().__init__(config)
        self.discriminator = PatchDiscriminator(2 * config["out_channels"] + 1)
        self.scheduler = scheduler_of(config)

    def draw(self, noise, *frame):
        return denoise(self.unet, self.text, noise, *frame, 1, scheduler=self.scheduler).float()


def one_step_init(folder, config):
    """-> weights of a renderer with DDIM and trailing timesteps, whose first step sees noise alone, and its defaults in
    model_index.json; the shape of its UNet and its prediction go to config"""
    scheduler = read_json(os.path.join(folder, "scheduler", "scheduler_config.json"))
    state = read_init(folder, config)
    config.update({name: scheduler[name] for name in ("prediction_type", "timestep_spacing")})
    expected = scheduler_of(config)
    if any(scheduler.get(name) != value for name, value in expected.items()) or config["timestep_spacing"] != "trailing":
        raise SystemExit(f"{folder}: scheduler: expected {({**expected, 'timestep_spacing': 'trailing'})}, found "
                         f"{scheduler}")
    return state, read_json(os.path.join(folder, "model_index.json"))["defaults"]["renderer"]


class Pairs:
    """crops of the latents of a frame and of the one before it"""

    def __init__(self, all_sequences, level, config):
        self.config, self.level, self.crop = config, level, crop_of(config, all_sequences)
        self.frames = [(s, i) for s in all_sequences for i in range(len(s))]

    def make(self, step, part=None):
        """-> the frame before as `denoise` takes it (previous, buffer, visible), its truth, the noise that this frame sees
        on it, whether this one has a previous frame [B, 1, 1, 1], its buffer, visibility and truth; where it counts"""
        draw, rows = generator(self.config, step), []
        for _ in range(self.config["batch"]):
            sequence, i = self.frames[number_below(len(self.frames), draw)]
            rows.append(self._pair(sequence, i, draw))
        rows = rows if part is None else rows[part.start:part.stop]
        previous, buffer, visible, truth, *this = (torch.stack(p).to(self.config["device"]) for p in zip(*rows))
        return (previous, buffer, visible), truth, *this

    def _pair(self, s, i, draw):
        place = crop_place(s, self.crop, draw)
        noise = torch.randn((2, *s.truth[0][place].shape), generator=draw)
        alone, before_alone = (torch.rand(2, generator=draw) < self.config["first_share"]).tolist()
        first = alone or bool(s.first[i])
        before = i if s.first[i] else i - 1
        previous = torch.zeros_like(noise[0])
        if not (before_alone or s.first[before]):
            previous = s.truth[before - 1][place] + self.level * noise[0]
        return (previous, s.buffer[before][place], s.visible[before][place], s.truth[before][place],
                self.level * noise[1], torch.full((1, 1, 1), not first), s.buffer[i][place], s.visible[i][place],
                s.truth[i][place], used_of(s, i)[place])


def seen_by(discriminator, latents, buffer, visible):
    return discriminator(torch.cat([latents, buffer, visible], 1))


def likeness_loss(model, made, truth, condition):
    """-> how far the discriminator's features of `made` are from the truth's, and how little it takes it for true; the
    discriminator itself learns nothing of it"""
    model.discriminator.requires_grad_(False)
    *of_made, verdict = seen_by(model.discriminator, made, *condition)
    model.discriminator.requires_grad_(True)
    with torch.no_grad():
        *of_truth, _ = seen_by(model.discriminator, truth, *condition)
    features = sum((a.float() - b.float()).abs().mean() for a, b in zip(of_made, of_truth))
    return features, (verdict.float() - 1).square().mean()


def discriminator_loss(model, made, truth, condition):
    """least squares (Mao et al. 2017, arXiv 1611.04076)"""
    of_truth, of_made = (seen_by(model.discriminator, x, *condition)[-1].float() for x in (truth, made.detach()))
    return ((of_truth - 1).square().mean() + of_made.square().mean()) / 2


def drawn(model, pairs, config, step, part):
    """-> latents that the model draws, true ones, buffer and visibility, where they count"""
    before, truth_before, noise, has_previous, buffer, visible, truth, used = pairs.make(step, part)
    random = draws(config, step, 1, part)
    starts = [random.normal(truth.shape[1:]).to(truth.device) for _ in range(2)]
    chained = (random.uniform((1, 1, 1)) < config["chained"]).to(truth.device)
    last = truth_before
    if chained.any():
        with torch.no_grad():
            last = torch.where(chained, model.draw(starts[0], *before), truth_before)
    previous = torch.where(has_previous, last + noise, torch.zeros_like(last))
    return model.draw(starts[1], previous, buffer, visible), truth, (buffer, visible), used


def error_of(made, truth, used):
    return mean_of_used((made - truth).abs(), used).mean()


def loss_of(pairs, config):
    def loss(model, step, part):
        made, truth, condition, used = drawn(model, pairs, config, step, part)
        error = error_of(made, truth, used)
        made = torch.where(used == 1, made, truth)  # what does not count seems as true as the truth
        features, doubted = likeness_loss(model, made, truth, condition)
        told_apart = discriminator_loss(model, made, truth, condition)
        total = config["error_weight"] * error + config["feature_weight"] * features + \
            config["discriminator_weight"] * doubted + told_apart
        return total, {name: float(value) for name, value in (("error", error), ("features", features),
                                                              ("doubted", doubted), ("told_apart", told_apart))}
    return loss


def error_of_held_out(pairs, config):
    def loss(model, step, part):
        made, truth, _, used = drawn(model, pairs, config, step, part)
        return error_of(made, truth, used), {}
    return loss


class OneStepExport(Export):
    def __call__(self, state):
        super().__call__({name: t for name, t in state.items() if not name.startswith(DISCRIMINATOR)})


def main(arguments=None):
    p = settings.parser("one_step_asd", __doc__)
    p.set_defaults(config="one_step")
    p.add_argument("--frames", required=True, help="folder of drives (see semtrain/frames.py)")
    p.add_argument("--held-out", help="folder of drives; each checkpoint logs their error, and draws of the first")
    p.add_argument("--init", required=True, help="model folder whose renderer it starts from")
    p.add_argument("--cache", help="folder for the frames' latents; default: OUT/latents")
    options = p.parse_args(arguments)
    config = settings.resolve("asd", options)
    state, defaults = one_step_init(options.init, config)
    config["defaults"] = {**defaults, "num_inference_steps": 1, "guidance_scale": 1.0}
    vae, cache = model_folder.vae_of(options.init), options.cache or os.path.join(options.output, "latents")
    torch.manual_seed(config["seed"])
    held = find_drives(options.held_out) if options.held_out else []
    made, held_out = (sequences(vae, drives, cache, config, mirrored) for drives, mirrored in
                      ((find_drives(options.frames), config["mirror"]), (held, False)))
    level = defaults["previous_noise"]
    export = OneStepExport(options.output, config, vae, (held_out[0], held[0]) if held else None)
    model = OneStep(config).to(memory_format=torch.channels_last)
    trainer = Trainer(options.output, model, config, export)
    trainer.start_from({**model.state_dict(), **state})
    trainer.run(loss_of(Pairs(made, level, config), config),
                error_of_held_out(Pairs(held_out, level, config), config) if held else None)


if __name__ == "__main__":
    main()

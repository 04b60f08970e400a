# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Trains a renderer ASD that draws in one step what a teacher draws in its own: for equal noise the teacher's DDIM, which
adds none, always comes to one latent, and the student learns it (Luhman & Luhman 2021, arXiv 2101.02388). A part of the
previous frames is what the student itself draws, as in a run."""
import os

import torch

from . import model_folder, settings
from .asd import Export, Renderer, read_init
from .denoising import SCHEDULER, denoise, mean_of_used, scheduler_of
from .draws import draws, generator, number_below
from .frames import find_drives
from .json_file import read_json
from .latents import crop_of, crop_place, sequences, used_of
from .trainer import Trainer


class Teacher:
    """a model folder, and its sampler with the settings that its defaults give"""

    def __init__(self, folder, config):
        self.scheduler = read_json(os.path.join(folder, "scheduler", "scheduler_config.json"))
        free = ("prediction_type", "timestep_spacing")
        for name, expected in SCHEDULER.items():
            if name not in free and self.scheduler.get(name) != expected:
                raise SystemExit(f"{folder}: scheduler: expected {name} {expected}, found {self.scheduler.get(name)}")
        if self.scheduler["timestep_spacing"] != "trailing":
            raise SystemExit(f"{folder}: expected timestep_spacing trailing, whose first step sees noise alone, found "
                             f"{self.scheduler['timestep_spacing']}")
        self.defaults = read_json(os.path.join(folder, "model_index.json"))["defaults"]["renderer"]
        self.state = read_init(folder, config)
        config.update({name: self.scheduler[name] for name in free})
        self.model = Renderer(config).eval().requires_grad_(False)
        self.model.load_state_dict({name: t.float() for name, t in self.state.items()})
        self.model.to(config["device"], memory_format=torch.channels_last)

    @torch.no_grad()
    def draw(self, noise, *frame):
        return denoise(self.model.unet, self.model.text, noise, *frame, self.defaults["num_inference_steps"],
                       self.defaults["guidance_scale"], self.scheduler)


class Pairs:
    """crops of the latents of a frame and of the one before it"""

    def __init__(self, all_sequences, level, config):
        self.config, self.level, self.crop = config, level, crop_of(config, all_sequences)
        self.frames = [(s, i) for s in all_sequences for i in range(len(s))]

    def make(self, step, part=None):
        """-> the frame before as `denoise` takes it (previous, buffer, visible), likewise this one, but for its previous,
        truth and noise of which are apart, and whether it has one [B, 1, 1, 1]; where it counts"""
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
        first = bool(s.first[i])
        before = i if first else i - 1  # whose own drawing is then not used
        previous = torch.zeros_like(noise[0])
        if not s.first[before]:
            previous = s.truth[before - 1][place] + self.level * noise[0]
        return (previous, s.buffer[before][place], s.visible[before][place], s.truth[before][place],
                self.level * noise[1], torch.full((1, 1, 1), not first), s.buffer[i][place], s.visible[i][place],
                used_of(s, i)[place])


def loss_of(pairs, teacher, config):
    def loss(model, step, part=None):
        before, truth, noise, has_previous, buffer, visible, used = pairs.make(step, part)
        random, scheduler = draws(config, step, 1, part), scheduler_of(config)

        def draw(start, *frame):
            return denoise(model.unet, model.text, start, *frame, 1, scheduler=scheduler).float()

        starts = [random.normal(truth.shape[1:]).to(truth.device) for _ in range(2)]
        chained = (random.uniform((1, 1, 1)) < config["chained"]).to(truth.device)
        with torch.no_grad():
            last = torch.where(chained, draw(starts[0], *before), truth)
        frame = torch.where(has_previous, last + noise, torch.zeros_like(last)), buffer, visible
        error = mean_of_used((draw(starts[1], *frame) - teacher.draw(starts[1], *frame)).square(), used)
        return error.mean(), {}
    return loss


def main(arguments=None):
    p = settings.parser("distil_asd", __doc__)
    p.set_defaults(config="distil")
    p.add_argument("--frames", required=True, help="folder of drives (see semtrain/frames.py)")
    p.add_argument("--held-out", help="folder of drives; each checkpoint logs their loss, and draws of the first")
    p.add_argument("--teacher", required=True, help="model folder; its defaults say how it samples")
    p.add_argument("--cache", help="folder for the frames' latents; default: OUT/latents")
    options = p.parse_args(arguments)
    config = settings.resolve("asd", options)
    teacher = Teacher(options.teacher, config)
    config["defaults"] = {**teacher.defaults, "num_inference_steps": 1, "guidance_scale": 1.0}
    vae, cache = model_folder.vae_of(options.teacher), options.cache or os.path.join(options.output, "latents")
    torch.manual_seed(config["seed"])
    held = find_drives(options.held_out) if options.held_out else []
    made, held_out = (sequences(vae, drives, cache, config, mirrored) for drives, mirrored in
                      ((find_drives(options.frames), config["mirror"]), (held, False)))
    losses = [loss_of(Pairs(of, teacher.defaults["previous_noise"], config), teacher, config) if of else None
              for of in (made, held_out)]
    export = Export(options.output, config, vae, (held_out[0], held[0]) if held else None)
    trainer = Trainer(options.output, Renderer(config).to(memory_format=torch.channels_last), config, export)
    trainer.start_from(teacher.state)
    print(f"{teacher.defaults['num_inference_steps']} steps of the teacher become one", flush=True)
    trainer.run(*losses)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Trains a transformer that gives in one pass what a teacher gives in several: its guided x0 (Meng et al. 2022, arXiv
2210.03142) or, with `teacher_steps` 2, what two steps of its sampler come to (Salimans & Ho 2022, arXiv 2202.00512)."""
import os

import torch

from .draws import draws
from .json_file import read_json
from .low_rank import FILE, merged, read_adapter
from .model_folder import add_to_index, read_component, write_component, write_scheduler
from .nets.transformer import VoxfieldTransformer
from .prefetch import Prefetched
from .regenerate import load_transformer, network_of
from .sampler import Guidance, guided_x0, linear_alphas, steps_of
from .settings import parser, resolve
from .trainer import Trainer
from .transformer import mean_error, noised_sets, sets_of, weights_of

TRANSFORMER, SCHEDULER = "voxfield_transformer", "voxfield_scheduler"


class Teacher:
    """FOLDER or FOLDER:PRESET of a model, and its sampler with the settings that its defaults, or a preset's, give"""

    def __init__(self, name, device):
        folder, _, preset = name.partition(":")
        self.folder = folder
        self.scheduler = read_json(os.path.join(folder, SCHEDULER, "scheduler_config.json"))
        index = read_json(os.path.join(folder, "model_index.json"))
        if preset and preset not in index.get("presets", {}):
            raise SystemExit(f"{folder} has no preset {preset}")
        defaults = {**index["defaults"], **(index["presets"][preset] if preset else {})}
        self.adapter = defaults.pop("adapter", FILE)
        self.defaults = {name: value for name, value in defaults.items() if value is not None}
        if self.defaults.get("known_tokens") != "clean":
            raise SystemExit(f"{folder}: expected a model whose known_tokens are clean")
        self.config = read_component(os.path.join(folder, TRANSFORMER))[0]
        self.model = load_transformer(os.path.join(folder, TRANSFORMER), self.adapter).to(device)
        self.guidance = Guidance.of(self.defaults)
        self.steps = steps_of(self.scheduler, self.defaults["num_inference_steps"],
                              self.defaults.get("prediction_error_scale", 1)).to(device)

    def first_steps(self, count):
        """of the groups of so many steps that a student takes as one -> [n / count]"""
        n = len(self.steps.timesteps)
        if n % count:
            raise SystemExit(f"teacher_steps {count}: the teacher takes {n} steps, which is no multiple of it")
        return torch.arange(0, n, count)

    @torch.no_grad()
    def x0_of(self, first, count, x, known, random, labels, centers, valid, condition):
        """x [B, N, 6n] before the steps `first` [B] -> the x0 [B, N, 6n] with which one step has the mean that `count`
        of the teacher have, with the noise that its sampler adds between them. Known voxels stay as they are"""
        total, share = torch.zeros_like(x), torch.zeros(len(x), 1, 1, device=x.device)
        for row in range(count):
            t, of_x0, of_x, fresh = (part[first + row] for part in self.steps)
            of_x0, of_x = of_x0[:, None, None], of_x[:, None, None]
            x0 = guided_x0(self.model, self.guidance, x, labels, centers, valid, t, condition)
            total, share = of_x * total + of_x0 * x0, of_x * share + of_x0
            if row + 1 < count:
                noise = random.normal(x.shape[1:]).to(x.device).unflatten(2, (-1, 2, 3))
                noise = (noise * fresh[:, None, None, :, None]).flatten(2)
                x = torch.where(known[..., None], x, of_x0 * x0 + of_x * x + noise)
        return total / share


class Distillation:
    """what a step trains on: sets of real voxels with noise on them, and what the teacher makes of these"""

    def __init__(self, teacher, sets, config):
        self.teacher, self.sets, self.config = teacher, sets, config
        self.alphas = linear_alphas(config).to(config["device"])
        self.weights = weights_of(self.alphas, config["snr_gamma"])
        self.first = teacher.first_steps(config["teacher_steps"]).to(config["device"])

    def drawn(self, step, rows=None, part=None):
        """rows [B]: which of the student's steps, drawn where it is None; part: a range of the batch's sets, None: all
        -> x, t, the other inputs of a network, the teacher's x0, the voxels that are not known"""
        config, random = self.config, draws(self.config, step, part=part)
        centers, labels, tokens, known, condition = (
            torch.from_numpy(array).to(config["device"]) for array in self.sets.batch(step, part))
        if rows is None:
            rows = random.below(len(self.first))
        first = self.first[rows.to(self.first.device)]
        t = self.teacher.steps.timesteps[first]
        x = noised_sets(tokens, known, condition, t, self.alphas, config, random)
        others = labels, centers, torch.ones_like(known)
        x0 = self.teacher.x0_of(first, config["teacher_steps"], x, known, random, *others, condition)
        return x, t, others, condition, x0, ~known

    def loss(self, model, step, part=None):
        x, t, others, condition, x0, target = self.drawn(step, part=part)
        made = model(x, *others, t, condition).float()
        places, colors = mean_error(made, x0, target, self.config["hue_weight"])
        of_colors = self.config["color_weight"]
        loss = ((places + of_colors * colors) / (1 + of_colors) * self.weights[t]).mean()
        return loss, {"places": float(places.mean()), "colors": float(colors.mean())}


def exporter(folder, config, teacher):
    """a model that needs no guidance, and as many steps as are left"""
    model = os.path.join(folder, "model")
    parts = {TRANSFORMER: ["semrover", "VoxfieldTransformer"], SCHEDULER: ["semrover", "DDPMScheduler"]}
    left = {name: value for name, value in teacher.defaults.items()
            if not name.startswith("guidance_") and name != "renderer"}
    steps = len(teacher.first_steps(config["teacher_steps"]))
    left.update(num_inference_steps=steps, distilled_steps=steps, guidance_scale=1.0)

    def export(state):
        write_component(os.path.join(model, TRANSFORMER), teacher.config, state, config["mantissa_bits"])
        write_scheduler(os.path.join(model, SCHEDULER), teacher.scheduler)
        add_to_index(model, parts, left)
    return export


def main(arguments=None):
    p = parser("distil", __doc__)
    p.set_defaults(config="distil")
    p.add_argument("--grids", nargs="+", required=True, help=".sgrid files with points, or folders of them")
    p.add_argument("--held-out", nargs="+", default=[], help="the same, of which the loss is logged alone")
    p.add_argument("--teacher", required=True, metavar="MODEL[:PRESET]",
                   help="model folder; its defaults, or those of a preset, say how it samples")
    p.add_argument("--init", help="a voxfield_transformer folder to start from; default: the teacher's")
    options = p.parse_args(arguments)
    config = resolve("transformer", options)
    teacher = Teacher(options.teacher, config["device"])
    config.update({name: teacher.scheduler[name] for name in ("num_train_timesteps", "beta_start", "beta_end")},
                  network=network_of(teacher.config))
    torch.manual_seed(config["seed"])
    student = VoxfieldTransformer(**config["network"])
    trainer = Trainer(options.output, student, config, exporter(options.output, config, teacher))
    init, adapter = (options.init, FILE) if options.init else \
        (os.path.join(teacher.folder, TRANSFORMER), teacher.adapter)
    trainer.start_from(merged(read_component(init)[1], read_adapter(init, adapter)))
    sets, held = sets_of(options.grids, options.output, "cache", config), None
    if options.held_out:
        held = Distillation(teacher, sets_of(options.held_out, options.output, "cache_held_out", config), config).loss
    distillation = Distillation(teacher, Prefetched(sets, config["workers"]), config)
    print(f"{len(teacher.steps.timesteps)} steps of the teacher become {len(distillation.first)}; "
          f"{len(sets.grids.labels)} cells", flush=True)
    trainer.run(distillation.loss, held)


if __name__ == "__main__":
    main()

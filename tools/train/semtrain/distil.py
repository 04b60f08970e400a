# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Trains a transformer that gives in one pass what a teacher gives in several: its guided x0 (Meng et al. 2022, arXiv
2210.03142) or, with `teacher_steps` 2, what two steps of its sampler come to (Salimans & Ho 2022, arXiv 2202.00512)."""
import os

import torch

from .grids import Grids, LocalSets
from .json_file import read_json
from .low_rank import merged, read_adapter
from .model_folder import add_to_index, read_component, write_component, write_scheduler
from .nets.transformer import VoxfieldTransformer
from .prefetch import Prefetched
from .regenerate import load_transformer, network_of
from .sampler import Guidance, guided_x0, linear_alphas, steps_of
from .settings import parser, resolve
from .trainer import Trainer, generator
from .transformer import mean_error, noised_sets, weights_of

TRANSFORMER, SCHEDULER = "voxfield_transformer", "voxfield_scheduler"


class Teacher:
    """a model folder, and its sampler with the settings that its defaults give"""

    def __init__(self, folder, device):
        self.folder = folder
        self.scheduler = read_json(os.path.join(folder, SCHEDULER, "scheduler_config.json"))
        self.defaults = read_json(os.path.join(folder, "model_index.json"))["defaults"]
        if self.defaults.get("known_tokens") != "clean":
            raise SystemExit(f"{folder}: expected a model whose known_tokens are clean")
        self.config = read_component(os.path.join(folder, TRANSFORMER))[0]
        self.model = load_transformer(os.path.join(folder, TRANSFORMER)).to(device)
        self.guidance = Guidance.of(self.defaults)
        self.steps = steps_of(self.scheduler, self.defaults["num_inference_steps"]).to(device)

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
                noise = torch.randn(x.shape, generator=random).to(x.device).unflatten(2, (-1, 2, 3))
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

    def drawn(self, step, rows=None):
        """rows [B]: which of the student's steps, drawn where it is None -> x, t, the other inputs of a network, the
        teacher's x0, the voxels that are not known"""
        config, random = self.config, generator(self.config, step)
        centers, labels, tokens, known, condition = (
            torch.from_numpy(part).to(config["device"]) for part in self.sets.batch(step))
        if rows is None:
            rows = torch.randint(len(self.first), (len(tokens),), generator=random)
        first = self.first[rows.to(self.first.device)]
        t = self.teacher.steps.timesteps[first]
        x = noised_sets(tokens, known, condition, t, self.alphas, config, random)
        others = labels, centers, torch.ones_like(known)
        x0 = self.teacher.x0_of(first, config["teacher_steps"], x, known, random, *others, condition)
        return x, t, others, condition, x0, ~known

    def loss(self, model, step):
        x, t, others, condition, x0, target = self.drawn(step)
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
    p.add_argument("--teacher", required=True, help="model folder; its defaults say how it samples")
    p.add_argument("--init", help="a voxfield_transformer folder to start from; default: the teacher's")
    options = p.parse_args(arguments)
    config = resolve("transformer", options)
    teacher = Teacher(options.teacher, config["device"])
    config.update({name: teacher.scheduler[name] for name in ("num_train_timesteps", "beta_start", "beta_end")},
                  network=network_of(teacher.config))
    torch.manual_seed(config["seed"])
    student = VoxfieldTransformer(**config["network"])
    trainer = Trainer(options.output, student, config, exporter(options.output, config, teacher))
    init = options.init or os.path.join(options.teacher, TRANSFORMER)
    trainer.start_from(merged(read_component(init)[1], read_adapter(init)))
    sets = LocalSets(Grids(options.grids, os.path.join(options.output, "cache")), config)
    distillation = Distillation(teacher, Prefetched(sets, config["workers"]), config)
    print(f"{len(teacher.steps.timesteps)} steps of the teacher become {len(distillation.first)}; "
          f"{len(sets.grids.labels)} cells", flush=True)
    trainer.run(distillation.loss)


if __name__ == "__main__":
    main()

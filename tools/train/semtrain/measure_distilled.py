# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""How far one pass of students is from what a teacher's sampler makes of the same sets (`run distil`), on streets that
neither was trained on: squared errors at the student's timesteps, a table in Markdown. The first row is the teacher's
own single pass, which is where a student begins."""
import argparse
import tempfile

import torch

from .distil import Distillation, Teacher
from .grids import Grids, LocalSets
from .precision import autocast
from .regenerate import load_transformer, network_of
from .settings import use_threads
from .transformer import mean_error

BANDS = ((0, 199), (200, 700), (701, 10000))  # of timesteps
CONFIG = {"seed": 7, "batch": 8, "label_dropout": 0, "class_balance": 0.35, "mirror": False, "ordered_points": True,
          "snr_gamma": 0, "known_share": 0.75, "known_levels": 1, "known_drift": 0, "device": "cpu",
          "telling": {"dropout": 0.3, "partial": 0, "local": 0, "noise": 0, "jitter": 0, "repaint": 0}}


@torch.no_grad()
def errors_of(models, drawn, batches):
    """-> of each model [bands, 2]: mean squared errors of places and of colours against the teacher, NaN in a band that
    has no timestep"""
    device = drawn.config["device"]
    sums, counts = torch.zeros(len(models), len(BANDS), 2), torch.zeros(len(BANDS))
    for step in range(batches):
        rows = (torch.arange(CONFIG["batch"]) + step * CONFIG["batch"]) % len(drawn.first)  # all in turn
        with autocast("bf16", device):
            x, t, others, condition, x0, target = drawn.drawn(step, rows)
            made = [model(x, *others, t, condition).float().clamp(-1, 1) for model in models]
        for band, (low, high) in enumerate(BANDS):
            inside = (t >= low) & (t <= high)
            counts[band] += inside.sum().cpu()
            for i, of_model in enumerate(made):
                errors = torch.stack(mean_error(of_model, x0, target), 1)
                sums[i, band] += errors[inside].sum(0).cpu()
    return sums / counts[:, None]


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run measure_distilled", description=__doc__)
    p.add_argument("--grids", nargs="+", required=True, help=".sgrid files with points, or folders of them")
    p.add_argument("--teacher", required=True, metavar="MODEL[:PRESET]", help="as `run distil` takes it")
    p.add_argument("--student", action="append", default=[], metavar="NAME=FOLDER",
                   help="a voxfield_transformer folder")
    p.add_argument("--teacher-steps", type=int, default=1, help="that one of the students' replaces")
    p.add_argument("--batches", type=int, default=12, help="of 8 sets")
    p.add_argument("--cells", type=int, default=128, help="of a set")
    p.add_argument("--device", default="cpu", help="or cuda")
    p.add_argument("--threads", type=int, default=0, help="of the CPU; 0: all")
    options = p.parse_args(arguments)
    use_threads(options.threads)
    teacher = Teacher(options.teacher, options.device)
    named = [item.split("=", 1) for item in options.student]
    config = {**CONFIG, **{name: teacher.scheduler[name] for name in ("num_train_timesteps", "beta_start", "beta_end")},
              "device": options.device, "set_size": [options.cells] * 2, "teacher_steps": options.teacher_steps,
              "network": network_of(teacher.config)}
    with tempfile.TemporaryDirectory() as cache:
        drawn = Distillation(teacher, LocalSets(Grids(options.grids, cache), config), config)
        models = [teacher.model, *(load_transformer(folder).to(options.device) for _, folder in named)]
        errors = errors_of(models, drawn, options.batches)
    bands = ("t < 200", "200 to 700", "above")
    head = ["model", *(f"{what}, {band}" for what in ("places", "colours") for band in bands)]
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for (name, _), of_model in zip([("teacher, one pass", ""), *named], errors):
        print("| " + " | ".join([name, *(f"{e:.5f}" for e in of_model.t().flatten())]) + " |", flush=True)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Generates held-back streets, refines trajectories through them, and compares the frames with those that the same
renderer makes of the streets' true points (semrover eval frames, kid, flicker): a table in Markdown, and all figures as
JSON. What is there already is kept; what was made with another model of the same name, or with other settings, is
refused."""
import argparse
import itertools
import json
import os

from .content import digest, digest_of_folder, keep_made_of
from .drives import drive_of, make_buffers
from .json_file import read_json, write_json
from .measure_frames import gather, mean_flicker
from .program import semrover

TRUE = "true points"


class Street:
    """a made street as a short trajectory sees it: FOLDER/{truth,semantic}.sgrid, objects.json, transforms.json"""

    def __init__(self, seed, folder, options):
        self.seed, self.folder = seed, folder
        if not os.path.exists(self.path("truth.sgrid")):
            os.makedirs(os.path.dirname(folder), exist_ok=True)
            where = {**drive_of(seed, options.frames, options.length), "yaw": 0, "shift": 0}
            semrover("streets", "--seed", seed, "--length", options.length, "--spacing", 1, "--seen", "--reach",
                     options.reach, "--placement", "canonical", "-W", options.width, "-H", options.height,
                     *(word for name, value in where.items() for word in (f"--{name}", value)), "-o", folder, "-y",
                     "--quiet")
            os.remove(self.path("mesh.glb"))
        self.numbers = range(len(read_json(self.path("transforms.json"))["frames"]))

    def path(self, name):
        return os.path.join(self.folder, name)


def generate(street, model, objects, grid):
    """the street's labels -> GRID"""
    objects = street.path("objects.json") if objects == "street" else objects
    semrover("generate", street.path("semantic.sgrid"), "-m", model, "-o", grid, "--seed", 1, "--objects", objects, "-y",
             "--quiet")


def frames_of(street, model, objects, folder, size):
    """FOLDER/SEED: points of the street (the truth's where `objects` is TRUE), their buffers, and refined frames"""
    base = os.path.join(folder, str(street.seed))
    frames = os.path.join(folder, "frames", str(street.seed))
    if os.path.exists(os.path.join(frames, "color")):
        return
    os.makedirs(base, exist_ok=True)
    grid = street.path("truth.sgrid")
    if objects != TRUE:
        grid = os.path.join(base, "points.sgrid")
        generate(street, model, objects, grid)
    make_buffers(grid, street.folder, base, size, "auto")
    semrover("refine", os.path.join(base, "buffer"), "-m", model, "-o", os.path.join(base, "refined"), "--seed", 1,
             "--path", street.path("transforms.json"), "--quiet", "-y")
    gather(os.path.join(base, "refined", "frames"), os.path.join(frames, "color"), street.numbers)


def judge(streets, folder, truth, features):
    """-> figures of FOLDER's frames against those of TRUTH, and their flicker by street"""
    def evaluate(what, *words):
        return json.loads(semrover("eval", what, *words, "--json", "--quiet"))

    frames = os.path.join(folder, "frames")
    out = {"flicker": {street.seed: evaluate("flicker", os.path.join(frames, str(street.seed), "color"), "--depth",
                                             os.path.join(folder, str(street.seed), "buffer", "depth"), "--path",
                                             street.path("transforms.json")) for street in streets}}
    if folder != truth:
        true_frames = os.path.join(truth, "frames")
        out["frames"] = evaluate("frames", frames, true_frames)
        if features:
            out["kid"] = evaluate("kid", frames, true_frames, "--features", features, "--full")
    return out


def line_of(name, objects, figures):
    """| model | objects | PSNR dB | SSIM | KID x 1000 | flicker |"""
    cells = ["-", "-", "-"]
    if "frames" in figures:
        cells[:2] = [f"{figures['frames']['psnr']:.2f}", f"{figures['frames']['ssim']:.3f}"]
    if "kid" in figures:
        cells[2] = f"{1000 * figures['kid']['full']:.1f}"
    return f"| {name} | {objects} | {' | '.join(cells)} | {mean_flicker(figures['flicker']):.2f} |"


def measure(streets, models, choices, options):
    lines = ["| model | objects | PSNR dB | SSIM | KID x 1000 | flicker |", "|" + "---|" * 6]
    for (name, model), objects in itertools.product(models, [TRUE, *choices]):
        folder, truth = (os.path.join(options.output, f"{name}-{what.replace(' ', '-')}") for what in (objects, TRUE))
        for street in streets:
            frames_of(street, model, objects, folder, (options.width, options.height))
        if not os.path.exists(folder + ".json"):
            write_json(folder + ".json", judge(streets, folder, truth, options.features))
        lines.append(line_of(name, objects, read_json(folder + ".json")))
        print(lines[-1], flush=True)
    return lines


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run measure_generated", description=__doc__)
    p.add_argument("-o", "--output", required=True, help="folder")
    p.add_argument("--model", action="append", required=True, metavar="NAME=FOLDER", help="model with a renderer")
    p.add_argument("--seeds", type=int, nargs="+", required=True, help="of streets that nothing was trained on")
    p.add_argument("--objects", nargs="+", choices=["none", "auto", "street"], default=["none"],
                   help="what the model is conditioned on")
    p.add_argument("--features", help="network for KID (docs/eval.md)")
    p.add_argument("--frames", type=int, default=12, help="of a street, 1 m apart")
    p.add_argument("--length", type=int, default=60, help="of a street, metres")
    p.add_argument("--reach", type=float, default=32, help="metres that are seen")
    p.add_argument("-W", "--width", type=int, default=616)
    p.add_argument("-H", "--height", type=int, default=424)
    options = p.parse_args(arguments)
    keep_made_of(options.output, {
        **{name: getattr(options, name) for name in ("seeds", "frames", "length", "reach", "width", "height")},
        "features": options.features and digest([options.features])})
    streets = [Street(seed, os.path.join(options.output, "streets", str(seed)), options) for seed in options.seeds]
    models = [item.split("=", 1) for item in options.model]
    keep_made_of(options.output, {f"model {name}": digest_of_folder(folder) for name, folder in models})
    lines = measure(streets, models, options.objects, options)
    with open(os.path.join(options.output, "table.md"), "w") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()

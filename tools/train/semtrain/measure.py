# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Generates held-back streets with several models, samplers, steps and guidance scales, and compares the points with
the true ones (semrover eval points): a table in Markdown, and all figures as JSON. Whatever is there already is kept;
what was made with another model of the same name, or of other cuts, is refused."""
import argparse
import itertools
import json
import os
import time

from .content import digest_of_folder, keep_made_of
from .json_file import read_json, write_json
from .program import semrover

CLASSES = ("road", "sidewalk", "building", "vegetation", "car", "road-lane")


def objects_of(cuts, name, model, objects, folder):
    """what `objects` means for a cut: none; the true ones of its street; or those guessed from all of its labels"""
    if objects == "none":
        return "none"
    if objects == "street":
        return os.path.join(cuts, "objects", name.replace(".sgrid", ".json"))
    guessed = os.path.join(folder, name.replace(".sgrid", ".guess.json"))
    semrover("convert", os.path.join(cuts, "street", name), guessed, "-m", model, "--seed", 1, "--quiet", "-y")
    return guessed


def generate(cuts, model, sampler, steps, guidance, objects, folder):
    """all of CUTS/semantic -> FOLDER; seconds"""
    os.makedirs(folder, exist_ok=True)
    begin = time.time()
    for name in sorted(os.listdir(os.path.join(cuts, "semantic"))):
        made = os.path.join(folder, name)
        if not os.path.exists(made):
            semrover("generate", os.path.join(cuts, "semantic", name), "-m", model, "-o", made, "--sampler", sampler,
                     "--steps", steps, "--cfg-scale", guidance, "--seed", 1, "--objects",
                     objects_of(cuts, name, model, objects, folder), "--quiet", "-y")
    return time.time() - begin


def measure(cuts, models, samplers, steps, guidances, choices, output):
    rows = []
    for (name, model), sampler, n, guidance, objects in itertools.product(models, samplers, steps, guidances, choices):
        setting = f"{name}-{sampler}-{n}-{guidance:g}" + ("" if objects == "none" else f"-{objects}")
        result = os.path.join(output, setting + ".json")
        if not os.path.exists(result):
            seconds = generate(cuts, model, sampler, n, guidance, objects, os.path.join(output, setting))
            scores = json.loads(semrover("eval", "points", os.path.join(output, setting), os.path.join(cuts, "truth"),
                                         "--json"))
            write_json(result, {"model": name, "sampler": sampler, "steps": n, "guidance": guidance, "told": objects,
                                "seconds": seconds, "scores": scores})
        rows.append(read_json(result))
        print(line_of(rows[-1]), flush=True)
    return rows


def line_of(row):
    """| model | sampler | steps | guidance | objects | mean colour error of CLASSES | all: voxel colour error |
    Chamfer | sharpness of windows and markings, detail of buildings and cars, spread of cars, against the truth's |
    ms a voxel |"""
    classes, every = row["scores"]["classes"], row["scores"]["all"]

    def ratio(name, figure="sharpness"):
        value = classes.get(name, {}).get(figure, {}).get("ratio")
        return "-" if value is None else f"{value:.2f}"
    cells = [row["model"], row["sampler"], str(row["steps"]), f"{row['guidance']:g}", row["told"]]
    cells += [f"{classes[c]['color_error']:.3f}" if c in classes else "-" for c in CLASSES]
    cells += [f"{every['cell_color_error']:.3f}", f"{every['chamfer']:.4f}", ratio("building"), ratio("road-lane"),
              ratio("building", "detail"), ratio("car", "detail"), ratio("car", "spread"),
              f"{1000 * row['seconds'] / every['cells']:.1f}"]
    return "| " + " | ".join(cells) + " |"


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run measure", description=__doc__)
    p.add_argument("cuts", help="folder with truth/ and semantic/, as `run cuts` writes it")
    p.add_argument("-o", "--output", required=True, help="folder")
    p.add_argument("--model", action="append", required=True, metavar="NAME=FOLDER")
    p.add_argument("--sampler", nargs="+", default=["ddpm"])
    p.add_argument("--steps", type=int, nargs="+", default=[5, 10, 20, 50, 250])
    p.add_argument("--guidance", type=float, nargs="+", default=[1.0, 1.5])
    p.add_argument("--objects", nargs="+", choices=["none", "auto", "street"], default=["none"],
                   help="what the model is conditioned on")
    options = p.parse_args(arguments)
    models = [item.split("=", 1) for item in options.model]
    keep_made_of(options.output, {"cuts": digest_of_folder(options.cuts),
                                  **{f"model {name}": digest_of_folder(folder) for name, folder in models}})
    head = ["model", "sampler", "steps", "guidance", "objects", *CLASSES, "voxel colour", "Chamfer m", "windows",
            "markings", "detail", "of cars", "spread of cars", "ms a voxel"]
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    rows = measure(options.cuts, models, options.sampler, options.steps, options.guidance, options.objects,
                   options.output)
    table = "| " + " | ".join(head) + " |\n|" + "---|" * len(head) + "\n" + "\n".join(map(line_of, rows)) + "\n"
    with open(os.path.join(options.output, "table.md"), "w") as file:
        file.write(table)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Refines drives that a renderer was not trained on, each frame from the one before and each alone, along the
trajectory and beside it, and compares the frames with the true ones (semrover eval frames, flicker, kid): a table in
Markdown, and all figures as JSON. What is there already is kept; what was made with another model, other frames or
settings is refused."""
import argparse
import json
import os
import shutil

from .content import digest, digest_of_folder, digest_of_pictures, keep_made_of
from .frames import find_made_drives, picture_name
from .json_file import read_json, write_json
from .program import semrover

BESIDE = "shifted"  # of a drive: the folder of the same street from beside it (semrover streets --shift)


class Pose:
    """the drives of one kind; their true frames and masks as `eval` wants them: OUT/truth-NAME/DRIVE/color,
    OUT/visible-NAME/DRIVE/visible"""

    def __init__(self, name, drives, output):
        self.name, self.drives = name, drives
        self.truth, self.visible = (os.path.join(output, f"{what}-{name}") for what in ("truth", "visible"))
        for key, drive in drives.items():
            gather(os.path.join(drive.folder, "color"), os.path.join(self.truth, key, "color"), drive.numbers)
            gather(os.path.join(drive.folder, "buffer", "visible"), os.path.join(self.visible, key, "visible"),
                   drive.numbers)


def gather(source, target, numbers):
    """the pictures of these numbers in a folder of their own"""
    os.makedirs(target, exist_ok=True)
    for number in numbers:
        name = picture_name(number)
        if not os.path.exists(os.path.join(target, name)):
            shutil.copy(os.path.join(source, name), target)


def poses_of(root, output):
    """-> [Pose]: seen, and shifted where there are such drives"""
    kinds = {"seen": {}, "shifted": {}}
    for drive in find_made_drives(root):
        name = os.path.relpath(drive.folder, root)
        kind = "shifted" if os.path.basename(name) == BESIDE else "seen"
        kinds[kind][name.split(os.sep)[0]] = drive
    return [Pose(kind, drives, output) for kind, drives in kinds.items() if drives]


def splats(pose, folder, options):
    """as the renderer gets them -> FOLDER/DRIVE/color, like the two below"""
    for key, drive in pose.drives.items():
        gather(os.path.join(drive.folder, "buffer", "color"), os.path.join(folder, key, "color"), drive.numbers)


def refined(pose, folder, options):
    """each frame from the one before it"""
    for key, drive in pose.drives.items():
        run = os.path.join(folder + ".runs", key)
        refine(drive, run, drive.numbers, options)
        gather(os.path.join(run, "frames"), os.path.join(folder, key, "color"), drive.numbers)


def alone(pose, folder, options):
    """each frame as if it were the first, with the noise that it has in `refined`"""
    for key, drive in pose.drives.items():
        for number in drive.numbers:
            run = os.path.join(folder + ".runs", key, str(number))
            refine(drive, run, [number], options, "--frames", f"{number}:{number}")
            gather(os.path.join(run, "frames"), os.path.join(folder, key, "color"), [number])


def refine(drive, folder, numbers, options, *more):
    """nothing where the frames of these numbers are there; a run that was stopped goes on"""
    if all(os.path.exists(os.path.join(folder, "frames", picture_name(number))) for number in numbers):
        return
    if options.steps:
        more += ("--steps", options.steps)
    if options.frame_noise:
        more += ("--frame-noise", options.frame_noise)
    os.makedirs(os.path.dirname(folder), exist_ok=True)
    semrover("refine", os.path.join(drive.folder, "buffer"), "-m", options.model, "-o", folder, "--seed", 1, "--quiet",
             "--path", os.path.join(drive.folder, "transforms.json"), *more)


def judge(pose, folder, options):
    """-> figures over all drives of the pose"""
    out = {"frames": json.loads(semrover("eval", "frames", folder, pose.truth, "--visible", pose.visible, "--json",
                                         "--quiet")), "flicker": {}}
    for key, drive in pose.drives.items():
        out["flicker"][key] = json.loads(semrover(
            "eval", "flicker", os.path.join(folder, key), "--depth", os.path.join(drive.folder, "depth"), "--path",
            os.path.join(drive.folder, "transforms.json"), "--truth", os.path.join(pose.truth, key), "--json",
            "--quiet"))
    if options.features:
        out["kid"] = json.loads(semrover("eval", "kid", folder, pose.truth, "--features", options.features, "--full",
                                         "--json", "--quiet"))
    return out


def mean_flicker(figures, mean_of=lambda pair: pair["mean"]):
    """-> mean over the pixels of all drives"""
    pairs = [pair for one in figures.values() for pair in one["pairs"]]
    return sum(mean_of(pair) * pair["valid"] for pair in pairs) / max(1, sum(pair["valid"] for pair in pairs))


def line_of(pose, name, figures):
    """| poses | frames | PSNR dB | where splats are | SSIM | KID x 1000 | flicker | truth's |"""
    made = mean_flicker(figures["flicker"])
    truth = mean_flicker(figures["flicker"], lambda pair: pair["truth"]["mean"])
    kid = f"{1000 * figures['kid']['full']:.1f}" if "kid" in figures else "-"
    frames = figures["frames"]
    decibels = ["equal" if of["psnr"] is None else f"{of['psnr']:.2f}" for of in (frames, frames["visible"])]
    return (f"| {pose} | {name} | {' | '.join(decibels)} | {frames['ssim']:.3f} | {kid} | {made:.2f} | {truth:.2f} |")


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run measure_frames", description=__doc__)
    p.add_argument("frames", help="folder of drives, as `run drives` writes it, with SEED/shifted or without")
    p.add_argument("-m", "--model", required=True, help="model with a renderer")
    p.add_argument("-o", "--output", required=True, help="folder")
    p.add_argument("--steps", type=int, default=0, help="denoising steps of a frame; 0: as the model says")
    p.add_argument("--frame-noise", choices=("fresh", "warped"), help="default: as the model says")
    p.add_argument("--features", help="network for KID (docs/eval.md)")
    options = p.parse_args(arguments)
    keep_made_of(options.output, {
        "model": digest_of_folder(options.model), "steps": options.steps, "frame_noise": options.frame_noise,
        "frames": digest_of_pictures([picture for drive in find_made_drives(options.frames)
                                      for picture in drive.pictures(drive.numbers)]),
        "features": options.features and digest([options.features])})
    lines = ["| poses | frames | PSNR dB | where splats are | SSIM | KID x 1000 | flicker | truth's |", "|" + "---|" * 8]
    for pose in poses_of(options.frames, options.output):
        for make in (splats, refined, alone):
            folder = os.path.join(options.output, f"{pose.name}-{make.__name__}")
            result = folder + ".json"
            if not os.path.exists(result):
                make(pose, folder, options)
                write_json(result, judge(pose, folder, options))
            lines.append(line_of(pose.name, make.__name__, read_json(result)))
    with open(os.path.join(options.output, "table.md"), "w") as file:
        file.write("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()

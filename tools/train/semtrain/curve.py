# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Loss curves as PNG, from the log.jsonl of a run."""
import json
import os


def draw_curve(log, picture):
    """the loss of each row, its running mean, and the loss of held-out data where the log has it"""
    if not os.path.exists(log):
        return
    with open(log) as file:
        all_rows = [json.loads(line) for line in file]
    rows, held_out = ([r for r in all_rows if name in r] for name in ("loss", "held_out"))
    if len(rows) < 2:
        return
    try:
        import matplotlib
    except ImportError:
        print(f"{picture} is not drawn: matplotlib is not installed", flush=True)
        return
    matplotlib.use("Agg")
    from matplotlib import pyplot
    steps, losses = [r["step"] for r in rows], [r["loss"] for r in rows]
    smooth, mean = [], losses[0]
    for loss in losses:
        mean += 0.1 * (loss - mean)
        smooth.append(mean)
    figure, axes = pyplot.subplots(figsize=(7, 4), dpi=110)
    axes.plot(steps, losses, color="0.75", linewidth=0.8, label="mean of 20 s")
    axes.plot(steps, smooth, color="C0", linewidth=1.5, label="running mean")
    if held_out:
        axes.plot([r["step"] for r in held_out], [r["held_out"] for r in held_out], "C1.-", label="held out")
    axes.set_xlabel("step")
    axes.set_ylabel("loss")
    axes.set_yscale("log")
    axes.grid(True, which="both", linewidth=0.3)
    axes.legend()
    figure.tight_layout()
    figure.savefig(picture)
    pyplot.close(figure)

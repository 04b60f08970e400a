# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""How far a transformer's x0 is off at each timestep, on streets that it was not trained on, with all conditions and no
voxel known; written into its model's scheduler as variance_type "analytic" (docs/method.md §3.2)."""
import argparse
import os
import tempfile

import torch

from .grids import Grids, LocalSets
from .held_out import CONFIG, errors_of
from .json_file import read_json
from .model_folder import write_scheduler
from .regenerate import load_transformer

LEVELS = [round(1000 * (i / 20) ** 2) - 1 for i in range(1, 21)]


def error_rows(model, sets, batches, of_places, of_colors):
    """-> [[timestep, places, colours]], what counts with these factors, three digits"""
    errors = errors_of(model, sets, batches, model.config["condition"], LEVELS)
    return [[t, float(f"{of_places * p:.3g}"), float(f"{of_colors * c:.3g}")] for t, (p, c) in zip(LEVELS, errors)]


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run variance", description=__doc__)
    p.add_argument("model", help="folder with voxfield_transformer/ and voxfield_scheduler/")
    p.add_argument("--grids", nargs="+", required=True, help=".sgrid files with points, or folders of them")
    p.add_argument("--places", type=float, default=1, help="how much the error of places counts")
    p.add_argument("--colors", type=float, default=1, help="how much the error of colours counts")
    p.add_argument("--batches", type=int, default=6, help="of 8 sets")
    p.add_argument("--cells", type=int, default=128, help="of a set")
    p.add_argument("--threads", type=int, default=0, help="of the CPU; 0: all")
    options = p.parse_args(arguments)
    torch.set_num_threads(options.threads or os.cpu_count())
    model = load_transformer(os.path.join(options.model, "voxfield_transformer"))
    with tempfile.TemporaryDirectory() as cache:
        config = {**CONFIG, "set_size": [options.cells] * 2, "network": model.config}
        sets = LocalSets(Grids(options.grids, cache), config)
        rows = error_rows(model, sets, options.batches, options.places, options.colors)
    folder = os.path.join(options.model, "voxfield_scheduler")
    scheduler = read_json(os.path.join(folder, "scheduler_config.json"))
    write_scheduler(folder, {**scheduler, "variance_type": "analytic", "prediction_errors": rows})


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Trains a PointNet++ to recognise the classes of a street's points; `semrover eval f3d` and `mmd` take its encoder as
--features (docs/eval.md)."""
import json
import os

import numpy as np
import torch
from torch.nn import functional as F

from . import safetensors_file
from .grids import find_grids
from .json_file import write_json
from .nets.norms import averaged
from .nets.pointnet import Pointnet
from .point_chunks import ChunkBatches, cut_chunks
from .settings import parser, resolve
from .trainer import Trainer

ENGINE_FIELDS = ("inputs", "chunk", "points", "min_points", "pool", "layers")
NORM_STREAM = 1  # of batches that the batch norms are measured on


def loss_of(batches, config):
    device = config["device"]
    weights = torch.from_numpy(batches.class_weights(config["class_balance"])).to(device)

    def loss(model, step, _=None):
        positions, inputs, labels = (torch.from_numpy(a).to(device) for a in batches.batch(step))
        model.train()
        labels = labels[:, :config["loss_points"]].flatten()
        logits = model(positions, inputs, config["loss_points"]).float().flatten(0, 1)
        right = (logits.detach().argmax(1) == labels).float().mean()
        return F.cross_entropy(logits, labels, weights), {"accuracy": float(right)}
    return loss


def write_network(path, network, state):
    """PATH.safetensors, and PATH.json as the engine wants it"""
    safetensors_file.write(path + ".safetensors", state, {"format": "pt"})
    write_json(path + ".json", {name: network[name] for name in ENGINE_FIELDS})


def read_network(path, network):
    """-> the module, ready to be asked"""
    model = Pointnet(network)
    model.load_state_dict(safetensors_file.read(path))
    return model.eval()


def exporter(folder, model, batches, config):
    def export(state):
        measured = (batches.batch(i, NORM_STREAM)[:2] for i in range(config["norm_batches"]))
        own = averaged(model, state, ((torch.from_numpy(a), torch.from_numpy(b), config["loss_points"])
                                      for a, b in measured))
        write_network(os.path.join(folder, "pointnet"), config["network"], own.state_dict())
    return export


@torch.no_grad()
def confusion(model, files, network, batch=8):
    """[classes, classes] points by class and by what the network says, on the chunks that the engine would cut"""
    table = np.zeros((network["num_classes"],) * 2, np.int64)
    for path in files:
        positions, inputs, labels, different = cut_chunks(path, network)
        for first in range(0, len(labels), batch):
            part = slice(first, first + batch)
            said = model(torch.from_numpy(positions[part]), torch.from_numpy(inputs[part])).argmax(2).numpy()
            once = np.arange(labels.shape[1]) < different[part, None]  # not those repeated to fill the chunk
            np.add.at(table, (labels[part][once], said[once]), 1)
    return table


def judge(table):
    """-> accuracy, mean IoU over the classes that occur, IoU of each"""
    inside, truth, said = np.diag(table), table.sum(1), table.sum(0)
    iou = {str(c): round(float(inside[c] / (truth[c] + said[c] - inside[c])), 4) for c in np.flatnonzero(truth)}
    return {"accuracy": round(float(inside.sum() / truth.sum()), 4),
            "mean_iou": round(float(np.mean(list(iou.values()))), 4), "iou": iou, "points": int(truth.sum())}


def main():
    p = parser("pointnet", __doc__)
    p.add_argument("--grids", nargs="+", required=True, help=".sgrid files with points, or folders of them")
    p.add_argument("--heldout", nargs="+", default=[], help="grids to report accuracy and IoU on at the end")
    options = p.parse_args()
    config = resolve("pointnet", options)
    batches = ChunkBatches(options.grids, os.path.join(options.output, "cache"), config)
    torch.manual_seed(config["seed"])
    model = Pointnet(config["network"])
    trainer = Trainer(options.output, model, config, exporter(options.output, model, batches, config))
    print(f"{sum(p.numel() for p in model.parameters())} parameters, {len(batches)} chunks", flush=True)
    trainer.run(loss_of(batches, config))
    if options.heldout:
        own = read_network(os.path.join(options.output, "pointnet.safetensors"), config["network"])
        report = judge(confusion(own, find_grids(options.heldout), config["network"]))
        write_json(os.path.join(options.output, "heldout.json"), report)
        print(json.dumps(report))


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Trains an Inception v3 on street frames; `semrover eval fid` and `kid` take it as --features (docs/eval.md).

Its features are trained for two questions at once, each asked by a linear layer: what a picture shows (the shares of
the 20 classes and of nothing: cross entropy), and how it was spoilt (the strength, 0..1, of every kind in
semtrain/damage.py: binary cross entropy). So they know both what streets look like and how well one is drawn.
"""
import json
import os

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from . import safetensors_file, settings
from .damage import KINDS, LEAST, spoil
from .draws import generator, number_below
from .frames import find_drives
from .json_file import write_json
from .nets.inception import Inception, resized
from .nets.norms import averaged
from .trainer import Trainer

CLASSES = 20
NORM_STREAM, JUDGED_STREAM = 1, 2  # of crops that batch norms are measured on, and that held-out drives are judged on
PRESENT = LEAST / 2                # a kind of damage is said to be there from this strength


class Frames:
    """truths, splat buffers and labels of some drives, in memory"""

    def __init__(self, root):
        self.frames = []
        for drive in find_drives(root):
            for number in drive.numbers:
                if number in drive.labels:
                    self.frames.append((drive.truth(number), drive.buffer(number), read_labels(drive.labels[number])))
        if not self.frames:
            raise SystemExit(f"{root}: no frame has label/000000.png, ...; `semrover streets --images` writes them")

    def crop(self, config, draw):
        """-> truth and buffer, float [3, H, W], and labels, of the same part of a frame, mirrored or not"""
        frame = self.frames[number_below(len(self.frames), draw)]
        share = config["crop"] + (1 - config["crop"]) * float(torch.rand(1, generator=draw))
        height, width = (max(1, round(share * n)) for n in frame[2].shape)
        top, left = (number_below(n - part + 1, draw) for n, part in zip(frame[2].shape, (height, width)))
        mirrored = number_below(2, draw)
        parts = [plane[..., top:top + height, left:left + width] for plane in frame]
        parts = [plane.flip(-1) if mirrored else plane for plane in parts]
        return parts[0].float(), parts[1].float(), parts[2]

    def batch(self, config, step, stream=0):
        """-> pictures [B, 3, 299, 299], shares of the classes [B, 21] and strengths of the damages [B, kinds]"""
        draw = generator(config, step, stream)
        images, shares, strengths = [], [], []
        for _ in range(config["batch"]):
            truth, buffer, labels = self.crop(config, draw)
            strengths.append(draw_strengths(config, draw))
            images.append(resized(spoil(truth, buffer, strengths[-1], draw)[None])[0])
            shares.append(shares_of(labels))
        images = torch.stack(images).contiguous(memory_format=torch.channels_last)
        return images, torch.stack(shares), torch.stack(strengths)


def read_labels(picture):
    """of a Picture -> uint8 [H, W], 20 for nothing"""
    with picture.open() as image:
        return torch.from_numpy(np.array(image.convert("L"))).clamp(max=CLASSES)


def shares_of(labels):
    """-> of each class, and of nothing, in a picture"""
    return torch.bincount(labels.flatten().long(), minlength=CLASSES + 1).float() / labels.numel()


def draw_strengths(config, draw):
    """-> [kinds]: all 0 in a share `clean` of the pictures, two above in a share `twice`, else one"""
    what = float(torch.rand(1, generator=draw))
    count = 0 if what < config["clean"] else 2 if what < config["clean"] + config["twice"] else 1
    chosen = torch.randperm(len(KINDS), generator=draw)[:count]
    strengths = torch.zeros(len(KINDS))
    strengths[chosen] = LEAST + (1 - LEAST) * torch.rand(count, generator=draw)
    return strengths


class Asked(nn.Module):
    """the network and the two questions; only the former is for the engine"""

    def __init__(self, config):
        super().__init__()
        self.network = Inception(config["width"], config["least"])
        self.shows = nn.Linear(self.network.features, CLASSES + 1)
        self.spoilt = nn.Linear(self.network.features, len(KINDS))

    def forward(self, images):
        """-> logits of shares and of strengths"""
        features = self.network(images).float()
        return self.shows(features), self.spoilt(features)


def loss_of(frames, config):
    def loss(model, step, _=None):
        images, shares, strengths = (t.to(config["device"]) for t in frames.batch(config, step))
        model.train()
        shows, spoilt = model(images)
        of_classes = F.cross_entropy(shows, shares)
        of_damage = F.binary_cross_entropy_with_logits(spoilt, strengths)
        with torch.no_grad():  # what perfect answers would cost is taken off
            about = {"classes": of_classes - F.cross_entropy((shares + 1e-9).log(), shares),
                     "damage": of_damage - F.binary_cross_entropy(strengths, strengths)}
        return of_classes + config["damage_weight"] * of_damage, {name: float(v) for name, v in about.items()}
    return loss


def ready(model, state, frames, config):
    """-> the averaged model, its norms measured"""
    return averaged(model, state, (frames.batch(config, i, NORM_STREAM)[:1] for i in range(config["norm_batches"])))


def write_network(path, network):
    safetensors_file.write(path, network.state_dict(), {"format": "pt"})


def read_network(path, config):
    """-> the module, ready to be asked"""
    network = Inception(config["width"], config["least"])
    network.load_state_dict(safetensors_file.read(path))
    return network.eval()


@torch.no_grad()
def answers(model, frames, config):
    """-> shares, the model's, strengths, the model's, of `judged_batches` batches of crops"""
    found = []
    for i in range(config["judged_batches"]):
        images, shares, strengths = frames.batch(config, i, JUDGED_STREAM)
        shows, spoilt = model(images)
        found.append((shares, shows.softmax(1), strengths, spoilt.sigmoid()))
    return [torch.cat(parts) for parts in zip(*found)]


def judge(shares, said_shares, strengths, said_strengths):
    """what held-out crops say: right, share of crops; error, mean difference; overlap_of_mean, of who answers always the
    same"""
    there, said = strengths > 0, said_strengths >= PRESENT
    kinds = {}
    for k, name in enumerate(KINDS):
        own = there[:, k]
        if own.any() and not own.all():
            kinds[name] = {"found": float(said[own, k].float().mean()), "invented": float(said[~own, k].float().mean()),
                           "error": float((said_strengths - strengths)[own, k].abs().mean())}
    report = {"crops": len(shares),
              "classes": {"largest_right": float((shares.argmax(1) == said_shares.argmax(1)).float().mean()),
                          "overlap": float(torch.minimum(shares, said_shares).sum(1).mean()),
                          "overlap_of_mean": float(torch.minimum(shares, shares.mean(0)).sum(1).mean())},
              "damage": {"all_right": float((there == said).all(1).float().mean()),
                         "each_right": float((there == said).float().mean()), "kinds": kinds}}
    return json.loads(json.dumps(report), parse_float=lambda text: round(float(text), 4))


def main(arguments=None):
    p = settings.parser("inception", __doc__.splitlines()[0])
    p.add_argument("--frames", required=True, help="folder of drives (see semtrain/frames.py) with label/000000.png")
    p.add_argument("--heldout", help="the same, to report at the end the share of right answers")
    options = p.parse_args(arguments)
    config = settings.resolve("inception", options)
    torch.manual_seed(config["seed"])
    frames = Frames(options.frames)
    model = Asked(config).to(memory_format=torch.channels_last)

    def export(state):
        own = ready(model, state, frames, config)
        write_network(os.path.join(options.output, "inception.safetensors"), own.network)
    trainer = Trainer(options.output, model, config, export)
    print(f"{sum(p.numel() for p in model.network.parameters())} parameters, {model.network.features} features, "
          f"{len(frames.frames)} frames", flush=True)
    trainer.run(loss_of(frames, config))
    if options.heldout:
        state = {name: t.detach().cpu() for name, t in trainer.average.items()}
        own = ready(model, state, frames, config)
        report = judge(*answers(own, Frames(options.heldout), config))
        write_json(os.path.join(options.output, "held_out.json"), report)
        print(json.dumps(report))


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Trains the Σ-Voxfield transformer (docs/method.md §2): x0-prediction, L2, sets of neighbouring voxels, of which a part
may be known; labels dropped in one set of ten."""
import os
from fnmatch import fnmatchcase

import torch
import torch.nn.functional as F

from . import processes
from .condition import width_of
from .draws import draws, timesteps_at
from .grids import Grids, LocalSets
from .low_rank import add_low_rank, is_adapter, merged, read_adapter
from .model_folder import add_to_index, read_component, write_component, write_scheduler
from .nets.transformer import VoxfieldTransformer
from .prefetch import Prefetched
from .sampler import linear_alphas
from .settings import parser, resolve
from .trainer import Trainer
from .usual_objects import usual_objects


def weights_of(alphas, gamma):
    """of the squared error at each timestep: 1 + min(SNR, gamma). 0 is the paper's plain L2, under which a small model
    learns little about the last steps: there its error is small already, but a road shows every centimetre. After
    min-SNR weighting (Hang et al. 2023, arXiv 2303.09556), which for x0-prediction has no 1 +."""
    return 1 + torch.clamp(alphas / (1 - alphas), max=gamma)


def noised(x0, alphas, t, random):
    """x0 [B, N, C] at the noise levels t [B]; random: Draws"""
    noise = random.normal(x0.shape[1:]).to(x0.device)
    a = alphas[t][:, None, None]
    return a.sqrt() * x0 + (1 - a).sqrt() * noise


def with_known(noisy, x0, known, alphas, top, random):
    """noisy, but voxels that are known [B, N] have the noise of a level below `top` only: what was generated before is a
    little worse than the truth"""
    t = random.below(top).to(x0.device)
    return torch.where(known[..., None], noised(x0, alphas, t, random), noisy)


def with_drift(x0, cells, strength, random):
    """tokens x0 [B, N, 6n]; in every other set the colours of the cells [B, N] are off, all by the same. What was
    generated before may have drifted away from its conditions, and must not lead away what comes next"""
    off = strength * random.normal((1, 1, 3))
    off *= random.uniform((1, 1, 1)) < 0.5
    tokens = x0.unflatten(2, (-1, 6)).clone()
    tokens[..., 3:] += torch.where(cells[..., None, None], off.to(x0.device), 0.0)
    return tokens.flatten(2)


def noised_sets(x0, known, condition, t, alphas, config, random):
    """tokens x0 [B, N, 6n] as a network sees them at the noise levels t [B]: known cells [B, N] nearly clean; their
    colours have drifted where a colour is given"""
    noisy, before = noised(x0, alphas, t, random), x0
    parts = config["network"].get("condition", [])
    if config["known_drift"] and "tint" in parts:
        has_tint = condition[..., width_of(parts[:parts.index("tint")])] > 0
        before = with_drift(x0, known & has_tint, config["known_drift"], random)
    return with_known(noisy, before, known, alphas, config["known_levels"], random) if config["known_share"] else noisy


def mean_error(made, x0, target, of_hue=1):
    """squared error of tokens [B, N, 6n] of the voxels that are targets [B, N] -> of places and of colours, [B] each; that
    of what is left of a colour without its grey counts `of_hue` times"""
    off = (made - x0).unflatten(2, (-1, 6))
    grey = off[..., 3:].mean(-1, keepdim=True)
    errors = off[..., :3].square().mean((2, 3)), \
        (off[..., 3:].square() + (of_hue - 1) * (off[..., 3:] - grey).square()).mean((2, 3))
    return tuple((error * target).sum(1) / target.sum(1) for error in errors)


def loss_of(sets, config):
    alphas, device = linear_alphas(config).to(config["device"]), config["device"]
    weights, of_colors = weights_of(alphas, config["snr_gamma"]), config["color_weight"]

    def loss(model, step, part=None):
        centers, labels, x0, known, condition = (torch.from_numpy(a).to(device) for a in sets.batch(step, part))
        random = draws(config, step, part=part)
        t = timesteps_at(random.uniform(), len(alphas), config["timestep_power"]).to(device)
        noisy = noised_sets(x0, known, condition, t, alphas, config, random)
        valid = torch.ones(labels.shape, dtype=torch.bool, device=device)
        conditions = (condition,) if condition.shape[-1] else ()
        places, colors = mean_error(model(noisy, labels, centers, valid, t, *conditions).float(), x0, ~known,
                                    config["hue_weight"])
        loss = ((places + of_colors * colors) / (1 + of_colors) * weights[t]).mean()
        return loss, {"places": float(places.mean()), "colors": float(colors.mean())}
    return loss


def with_new_parts(state, model):
    """weights of a model with fewer conditions than `model`, and what `model` begins with for the rest: conditions that
    are new change nothing at first"""
    first = "condition_embed.linear_1.weight"
    new = {name: t for name, t in model.state_dict().items() if name.startswith("condition_embed.") or is_adapter(name)}
    state = {**new, **state}
    more = model.state_dict()[first].shape[1] - state[first].shape[1] if first in state else 0
    if more > 0:
        state[first] = F.pad(state[first], (0, more))
    return state


def train_only(model, patterns):
    """the parameters whose names match one of these (`*` stands for anything), and adapters; all where there are none"""
    parameters = dict(model.named_parameters())
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in parameters):
            some = ", ".join([*parameters][:3])
            raise SystemExit(f"train_only: no parameter is called {pattern}; there are {some}, ...")
    for name, p in parameters.items():
        p.requires_grad_(not patterns or is_adapter(name) or any(fnmatchcase(name, pattern) for pattern in patterns))


def exporter(folder, config, grids):
    """grids: Grids, which say how points were placed and how objects usually are"""
    placement, defaults = grids.placement, dict(config["defaults"])
    if config["network"].get("condition"):
        defaults["objects"] = usual_objects(grids.files)
    placed = {} if placement == "shifted" else {"placement": placement}

    def export(state):
        write_component(os.path.join(folder, "model", "voxfield_transformer"),
                        {"_class_name": "VoxfieldTransformer", **config["network"], **placed,
                         "prediction_type": "sample"},
                        state, config["mantissa_bits"])
        write_scheduler(os.path.join(folder, "model", "voxfield_scheduler"), {
            "_class_name": "DDPMScheduler", "num_train_timesteps": config["num_train_timesteps"],
            "beta_start": config["beta_start"], "beta_end": config["beta_end"], "beta_schedule": "linear",
            "prediction_type": "sample", "clip_sample": True, "variance_type": "fixed_small",
            "timestep_spacing": "trailing"})
        add_to_index(os.path.join(folder, "model"), {"voxfield_transformer": ["semrover", "VoxfieldTransformer"],
                                                     "voxfield_scheduler": ["semrover", "DDPMScheduler"]},
                     defaults)
    return export


def sets_of(sources, output, cache, config):
    """LocalSets of grids, which are kept in OUTPUT/CACHE"""
    with processes.rank_0_first():
        grids = Grids(sources, os.path.join(output, cache))
    return LocalSets(grids, config)


def main():
    p = parser("transformer", __doc__)
    p.add_argument("--grids", nargs="+", required=True, help=".sgrid files with points, or folders of them")
    p.add_argument("--held-out", nargs="+", default=[], help="the same, of which the loss is logged alone")
    p.add_argument("--init", help="a voxfield_transformer folder to start from")
    options = p.parse_args()
    config = resolve("transformer", options)
    sets, held = sets_of(options.grids, options.output, "cache", config), None
    if options.held_out:
        held = loss_of(sets_of(options.held_out, options.output, "cache_held_out", config), config)
    torch.manual_seed(config["seed"])
    model = VoxfieldTransformer(**config["network"])
    model.start_at_zero()
    add_low_rank(model, config["low_rank"], config["low_rank_of"])
    train_only(model, config["train_only"])
    trainer = Trainer(options.output, model, config, exporter(options.output, config, sets.grids))
    if options.init:
        state, adapter = read_component(options.init)[1], read_adapter(options.init)
        trainer.start_from(with_new_parts({**state, **adapter} if config["low_rank"] else merged(state, adapter), model))
    print(f"{sum(p.numel() for p in model.parameters())} parameters, {len(sets.grids.labels)} cells", flush=True)
    trainer.run(loss_of(Prefetched(sets, config["workers"]), config), held)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""PointNet++ with single-scale grouping for segmentation (Qi et al. 2017), tensors named as in
models/pointnet2_sem_seg.py of github.com/yanx27/Pointnet_Pointnet2_pytorch. Points are chosen and grouped by the rules
of the engine (docs/eval.md)."""
import torch
from torch import nn
from torch.nn import functional as F


def squared_distances(axes, others):
    """x, y, z of [...] and of [...] -> [...]; summed in one order, so that ties are ties everywhere"""
    squares = [(a - b).square_() for a, b in zip(axes, others)]
    return squares[0].add_(squares[1]).add_(squares[2])


def farthest_points(points, count):
    """[B, N, 3] -> [B, count]: point 0, then again and again the farthest from those chosen, ties to the lower index"""
    sets, n = points.shape[:2]
    axes = [points[..., a].contiguous() for a in range(3)]
    chosen = torch.zeros(sets, count, dtype=torch.int64, device=points.device)
    nearest = torch.full((sets, n), float("inf"), device=points.device)
    for s in range(count - 1):
        last = chosen[:, s:s + 1]
        apart = squared_distances(axes, [axis.gather(1, last) for axis in axes])
        torch.minimum(nearest, apart, out=nearest)
        chosen[:, s + 1] = nearest.argmax(1)
    return chosen


def ball_query(points, centers, radius, count):
    """[B, N, 3], [B, S, 3] -> [B, S, count]: the first points with d^2 <= radius^2; too few: the first of them again;
    none: point 0"""
    squared = torch.tensor(radius, dtype=torch.float32) ** 2
    groups = []
    for own, middle in zip(points, centers):
        apart = squared_distances(own.t().contiguous(), middle.t().contiguous()[..., None])
        row, point = (apart <= squared).nonzero(as_tuple=True)
        found = torch.bincount(row, minlength=len(middle))
        start = found.cumsum(0) - found
        place = torch.arange(len(row), device=row.device) - start[row]
        first = torch.where(found > 0, point[start.clamp(max=max(len(point) - 1, 0))] if len(point) else 0, 0)
        group = first[:, None].repeat(1, count)
        keep = place < count
        group[row[keep], place[keep]] = point[keep]
        groups.append(group)
    return torch.stack(groups)


def take(values, index):
    """[B, N, C], [B, ...] -> [B, ..., C]"""
    flat = index.flatten(1)
    return values.gather(1, flat[..., None].expand(-1, -1, values.shape[2])).unflatten(1, index.shape[1:])


def three_nearest(points, centers):
    """[B, N, 3], [B, S, 3] -> indices [B, N, 3 or S] and weights, in inverse proportion to the squared distance"""
    apart, index = torch.cdist(points, centers).square_().topk(min(3, centers.shape[1]), dim=2, largest=False)
    weights = 1 / (apart + 1e-8)
    return index, weights / weights.sum(2, keepdim=True)


class SharedMlp(nn.Module):
    """a linear layer, batch norm and ReLU for each of `widths`, over rows"""

    def __init__(self, width, widths, dims):
        super().__init__()
        convolution = {1: nn.Conv1d, 2: nn.Conv2d}[dims]  # that is what the tensors' shapes come from
        self.mlp_convs = nn.ModuleList(convolution(a, b, 1) for a, b in zip([width] + widths, widths))
        self.mlp_bns = nn.ModuleList(nn.BatchNorm1d(n) for n in widths)

    def apply_to(self, rows):
        for conv, norm in zip(self.mlp_convs, self.mlp_bns):
            rows = F.relu(over_rows(norm, F.linear(rows, conv.weight.flatten(1), conv.bias)))
        return rows


def over_rows(norm, rows):
    """batch norm of [R, C]; as an image, for which PyTorch has bf16 too"""
    image = rows.view(1, len(rows), 1, -1).permute(0, 3, 1, 2)
    if norm.training:
        norm.num_batches_tracked += 1
    momentum = norm.momentum if norm.momentum is not None else 1 / max(1, int(norm.num_batches_tracked))
    image = F.batch_norm(image, norm.running_mean, norm.running_var, norm.weight, norm.bias, norm.training, momentum,
                         norm.eps)
    return image.permute(0, 2, 3, 1).reshape(rows.shape)


class SetAbstraction(SharedMlp):
    def __init__(self, width, layer):
        super().__init__(3 + width, layer["mlp"], 2)
        self.layer = layer

    def forward(self, features, points, centers, members):
        """[B, N, C], [B, N, 3], [B, S, 3], [B, S, K] -> [B, S, C']"""
        offsets = take(points, members) - centers[:, :, None]
        rows = torch.cat([offsets.to(features.dtype), take(features, members)], -1)
        return self.apply_to(rows.flatten(0, 2)).view(*members.shape, -1).max(2)[0]


class FeaturePropagation(SharedMlp):
    def __init__(self, width, widths):
        super().__init__(width, widths, 1)

    def forward(self, skip, features, index, weights):
        """skip [B, N, C] or None, features [B, S, D] of the layer above -> [B, N, C']"""
        y = (take(features, index) * weights[..., None].to(features.dtype)).sum(2)
        y = y if skip is None else torch.cat([skip, y], -1)
        return self.apply_to(y.flatten(0, 1)).view(*y.shape[:2], -1)


class Pointnet(nn.Module):
    """`network` has inputs, points, pool, layers (as the engine's config), decoder (widths of fp1, fp2, ..), head and
    num_classes"""

    def __init__(self, network):
        super().__init__()
        self.network, self.depth = network, len(network["layers"])
        widths = [3 * len(network["inputs"])]
        for i, layer in enumerate(network["layers"], 1):
            setattr(self, f"sa{i}", SetAbstraction(widths[-1], layer))
            widths.append(layer["mlp"][-1])
        above = widths[-1]
        for i in range(self.depth, 0, -1):
            of_layer = network["decoder"][i - 1]
            setattr(self, f"fp{i}", FeaturePropagation(above + (widths[i - 1] if i > 1 else 0), of_layer))
            above = of_layer[-1]
        self.conv1 = nn.Conv1d(above, network["head"], 1)
        self.bn1 = nn.BatchNorm1d(network["head"])
        self.conv2 = nn.Conv1d(network["head"], network["num_classes"], 1)

    @torch.no_grad()
    def geometry(self, positions):
        """[B, N, 3] -> for every layer its centers [B, S, 3] and members [B, S, K]"""
        levels = []
        for layer in self.network["layers"]:
            centers = take(positions, farthest_points(positions, layer["npoint"]))
            levels.append((centers, ball_query(positions, centers, layer["radius"], layer["nsample"])))
            positions = centers
        return levels

    def encode(self, positions, inputs, levels):
        """-> the features of each layer's points, the inputs first"""
        features = [inputs]
        for i, (centers, members) in enumerate(levels, 1):
            features.append(getattr(self, f"sa{i}")(features[-1], positions, centers, members))
            positions = centers
        return features

    def describe(self, positions, inputs):
        """what the engine computes: [B, N, 3], [B, N, W] -> [B, D]"""
        last = self.encode(positions, inputs, self.geometry(positions))[-1]
        return last.max(1)[0] if self.network["pool"] == "max" else last.mean(1)

    def forward(self, positions, inputs, first=None):
        """-> [B, N, num_classes] logits, or only of the `first` points of every set"""
        levels = self.geometry(positions)
        features = self.encode(positions, inputs, levels)
        places = [positions[:, :first]] + [centers for centers, _ in levels]
        y = features[-1]
        for i in range(self.depth, 0, -1):
            index, weights = three_nearest(places[i - 1], places[i])
            y = getattr(self, f"fp{i}")(features[i - 1] if i > 1 else None, y, index, weights)
        rows = F.linear(y.flatten(0, 1), self.conv1.weight.flatten(1), self.conv1.bias)
        rows = F.relu(over_rows(self.bn1, rows))
        return F.linear(rows, self.conv2.weight.flatten(1), self.conv2.bias).view(*y.shape[:2], -1)

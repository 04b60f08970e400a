# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of Σ-Voxfield grids as sets of equally many labelled points: as the engine's cut_chunks cuts them
(tools/eval/point_chunks.h), and as batches to train on."""
import os

import numpy as np

from .grids import find_grids, read_grid
from .json_file import read_json, write_json


def read_points(path):
    """-> positions f32 [P, 3] metres, colors u8 [P, 3], labels u8 [P], in the engine's order: by voxel"""
    t, size = read_grid(path)
    order = np.lexsort(t["cells"].T[::-1])
    centers = ((t["cells"][order] + 0.5) * np.float64(np.float32(size))).astype(np.float32)
    points = centers[:, None] + t["points"][order].astype(np.float32)
    return points.reshape(-1, 3), t["colors"][order].reshape(-1, 3), np.repeat(t["labels"][order], points.shape[1])


def scatter(x):
    """splitmix64's output function"""
    with np.errstate(over="ignore"):
        x = x + np.uint64(0x9e3779b97f4a7c15)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xbf58476d1ce4e5b9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94d049bb133111eb)
        return x ^ (x >> np.uint64(31))


def columns_of(positions, chunk):
    """indices of the points of every column, columns by x, then y -> [((i, j), indices)]"""
    place = np.floor(positions[:, :2].astype(np.float64) / chunk).astype(np.int64)
    order = np.lexsort((place[:, 1], place[:, 0]))
    place = place[order]
    starts = np.flatnonzero(np.r_[True, (np.diff(place, axis=0) != 0).any(1)]) if len(order) else []
    return [(tuple(place[s]), part) for s, part in zip(starts, np.split(order, starts[1:]))]


def origin_of(column, positions, chunk):
    return np.array([(column[0] + 0.5) * chunk, (column[1] + 0.5) * chunk, positions[:, 2].min()])


def inputs_of(network, positions, colors, origin, limits):
    """positions in the world, `limits` [2, 3] of the grid -> positions in the chunk and {name: input}"""
    own = (positions.astype(np.float64) - origin).astype(np.float32)
    extent = limits[1] - limits[0]
    normalized = np.where(extent > 0, (positions - limits[0]) / np.where(extent > 0, extent, 1), 0).astype(np.float32)
    named = {"xyz": own, "rgb": colors.astype(np.float32) / np.float32(255), "normalized": normalized}
    return own, {name: named[name] for name in network["inputs"]}


def cut_chunks(path, network, seed=0):
    """what the engine feeds its network -> positions [C, N, 3], inputs [C, N, W], labels [C, N], different [C]: how
    many points of a chunk are not repeated"""
    positions, colors, labels = read_points(path)
    limits = np.stack([positions.min(0), positions.max(0)])
    rank = scatter(scatter(np.uint64(seed)) ^ np.arange(len(positions), dtype=np.uint64))
    chunks = []
    for column, own in columns_of(positions, network["chunk"]):
        if len(own) < network["min_points"]:
            continue
        origin = origin_of(column, positions[own], network["chunk"])
        own = own[np.argsort(rank[own])]
        drawn = own[np.arange(network["points"]) % len(own)]
        places, inputs = inputs_of(network, positions[drawn], colors[drawn], origin, limits)
        chunks.append((places, np.concatenate(list(inputs.values()), -1), labels[drawn],
                       min(len(own), network["points"])))
    if not chunks:
        raise SystemExit(f"{path}: no column of {network['chunk']} m has {network['min_points']} points")
    return tuple(np.stack(part) for part in zip(*chunks))


class ChunkBatches:
    """All columns of some grids, their points column by column in files under `cache`, mapped to memory."""

    def __init__(self, sources, cache, config):
        self.config, self.network = config, config["network"]
        files = find_grids(sources)
        key = {"files": files, "chunk": self.network["chunk"], "min_points": self.network["min_points"]}
        os.makedirs(cache, exist_ok=True)
        about = os.path.join(cache, "chunks.json")
        if not os.path.exists(about) or read_json(about) != key:
            self._fill(files, cache)
            write_json(about, key)
        self.positions, self.colors = (np.load(os.path.join(cache, f"{name}.npy"), mmap_mode="r")
                                       for name in ("positions", "colors"))
        self.labels, self.ends, self.origins, self.limits = (
            np.load(os.path.join(cache, f"{name}.npy")) for name in ("labels", "ends", "origins", "limits"))

    def __len__(self):
        return len(self.ends)

    def _fill(self, files, cache):
        columns = {name: [] for name in ("positions", "colors", "labels", "origins", "limits")}
        for path in files:
            positions, colors, labels = read_points(path)
            limits = np.stack([positions.min(0), positions.max(0)])
            for column, own in columns_of(positions, self.network["chunk"]):
                if len(own) >= self.network["min_points"]:
                    origin = origin_of(column, positions[own], self.network["chunk"])
                    for name, part in zip(columns, (positions[own], colors[own], labels[own], origin, limits)):
                        columns[name].append(part)
        if not columns["labels"]:
            raise SystemExit(f"no column of {self.network['chunk']} m has {self.network['min_points']} points")
        np.save(os.path.join(cache, "ends.npy"), np.cumsum([len(part) for part in columns["labels"]]))
        for name in ("positions", "colors", "labels"):
            np.save(os.path.join(cache, f"{name}.npy"), np.concatenate(columns[name]))
        for name in ("origins", "limits"):
            np.save(os.path.join(cache, f"{name}.npy"), np.stack(columns[name]))

    def class_weights(self, power):
        """[num_classes] frequency to -power, so that the mean over all points is 1; 1 for classes that do not occur"""
        counts = np.bincount(self.labels, minlength=self.network["num_classes"]).astype(np.float64)
        share = counts / counts.sum()
        weights = np.where(counts > 0, np.maximum(share, 1e-12) ** -power, 0)
        return np.where(counts > 0, weights / (weights * share).sum(), 1).astype(np.float32)

    def batch(self, step, stream=0):
        """positions [B, N, 3], inputs [B, N, W], labels [B, N] as fp32, fp32, i64 arrays"""
        random = np.random.default_rng([self.config["seed"], stream, step])
        chunks = [self._chunk(random) for _ in range(self.config["batch"])]
        return tuple(np.stack(part) for part in zip(*chunks))

    def _chunk(self, random):
        c = int(random.integers(len(self.ends)))
        first, count = (int(self.ends[c - 1]) if c else 0), self.network["points"]
        order = random.permutation(int(self.ends[c]) - first)
        drawn = first + order[np.arange(count) % len(order)]
        own, inputs = inputs_of(self.network, self.positions[drawn], self.colors[drawn], self.origins[c],
                                self.limits[c])
        for axis in range(2):  # streets mirrored in either direction are streets
            if self.config["mirror"] and random.random() < 0.5:
                own[:, axis] *= -1
                if "normalized" in inputs:
                    inputs["normalized"][:, axis] = 1 - inputs["normalized"][:, axis]
        if self.config["turn"] and random.random() < 0.5:
            for values in (own, inputs.get("normalized")):
                if values is not None:
                    values[:, :2] = values[:, 1::-1].copy()
        return own, np.concatenate(list(inputs.values()), -1), self.labels[drawn].astype(np.int64)

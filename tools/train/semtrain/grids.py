# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Σ-Voxfield grids (.sgrid) as training data: tokens of all voxels of many grids in one array, and local sets of them."""
import glob
import os

import numpy as np
from scipy.spatial import cKDTree

from . import safetensors_file
from .condition import drawn_boxes, drawn_tints, mirrored, given_boxes, given_parts, given_tints, vector_of, width_of
from .content import digest
from .json_file import read_json, write_json
from .known_cells import draw_known
from .objects import local_tints, objects_beside, owned
from .repaint import repaint


def find_grids(sources):
    """.sgrid files; of a folder all below it but semantic ones"""
    files = []
    for source in sources:
        found = sorted(glob.glob(os.path.join(source, "**", "*.sgrid"), recursive=True)) if os.path.isdir(source) else [source]
        files += [f for f in found if "semantic" not in os.path.basename(f)]
    if not files:
        raise SystemExit(f"no grids with points in {', '.join(sources)}; tools/train/run streets makes some")
    return files


def read_grid(path):
    """-> {cells i32 [V, 3], labels u8 [V], points f16 [V, n, 3], colors u8 [V, n, 3]} of the voxels that have points, and
    voxel size in metres"""
    t = {name: tensor.numpy() for name, tensor in safetensors_file.read(path).items()}
    if "points" not in t:
        raise SystemExit(f"{path}: a semantic grid; points and colours are needed")
    has = t.pop("generated").astype(bool) if "generated" in t else np.ones(len(t["cells"]), bool)
    return {name: values[has] for name, values in t.items()}, float(safetensors_file.read_header(path)[1]["voxel_size"])


def token_order(points):
    """points [V, n, 3 or more] -> [V, n, 1]: nearest to the voxel's centre first, ties by x, y, z"""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.lexsort((z, y, x, (points[..., :3] ** 2).sum(-1)), axis=-1)[..., None]


def read_tokens(path):
    """-> voxels i32 [V, 3], labels u8 [V], tokens f16 [V, 6n] in [-1, 1], the point nearest the voxel's centre first
    (ties by x, y, z); only voxels that have points"""
    t, size = read_grid(path)
    points, colors = t["points"].astype(np.float32), t["colors"].astype(np.float32)
    order = token_order(points)
    points, colors = np.take_along_axis(points, order, 1), np.take_along_axis(colors, order, 1)
    tokens = np.concatenate([points / (size / 2), colors / 127.5 - 1], -1).reshape(len(points), -1)
    return t["cells"], t["labels"], tokens.clip(-1, 1).astype(np.float16)


def placement_of(path):
    """how the points of an .sgrid were placed (docs/method.md §1.3)"""
    return safetensors_file.read_header(path)[1].get("placement", "shifted")


def read_owners(path, cells, labels):
    """the objects.json beside a .sgrid, if there is one -> owners i32 [V], tints near each voxel u8 [V, 3], boxes
    f64 [O, 7], tints of the objects f32 [O, 3]; of the parts owners, boxes and tints"""
    grid, size = read_grid(path)
    centers = (cells + 0.5) * size
    owners, boxes, tints = owned(path, centers, labels)
    return owners, local_tints(centers, owners, grid["colors"]), boxes, tints, *owned(path, centers, labels, parts=True)


class Grids:
    """All grids of some sources, kept as one file each of voxels, labels, tokens and what their objects are under
    `cache`, mapped to memory. They are made anew when the bytes of a grid or of its objects are other ones."""

    ARRAYS = ("cells", "labels", "tokens", "owners", "local_tints", "boxes", "tints", "parts", "part_boxes", "part_tints")
    NUMBERED = (("owners", "boxes"), ("parts", "part_boxes"))  # the ones are indices of the others, numbered through

    def __init__(self, sources, cache):
        self.files = files = find_grids(sources)
        os.makedirs(cache, exist_ok=True)
        about = os.path.join(cache, "grids.json")
        content = digest([path for f in files for path in (f, objects_beside(f))], " ".join(self.ARRAYS))
        if not os.path.exists(about) or read_json(about).get("content") != content:
            self._fill(files, cache, about, content)
        self.offsets = read_json(about)["offsets"]
        placements = {placement_of(f) for f in files}
        self.placement = placements.pop() if len(placements) == 1 else "mixed"
        for name in self.ARRAYS:
            mode = "r" if name in ("cells", "tokens") else None
            setattr(self, name, np.load(os.path.join(cache, f"{name}.npy"), mmap_mode=mode))

    @classmethod
    def _fill(cls, files, cache, about, content):
        parts = [cls._arrays(f) for f in files]
        for numbers, things in (map(cls.ARRAYS.index, names) for names in cls.NUMBERED):
            for part, first in zip(parts, np.cumsum([0] + [len(p[things]) for p in parts])):
                part[numbers][part[numbers] >= 0] += first
        for i, name in enumerate(cls.ARRAYS):
            path = os.path.join(cache, f"{name}.npy")
            np.save(path + ".part.npy", np.concatenate([p[i] for p in parts]))
            os.replace(path + ".part.npy", path)  # who has the former one mapped keeps it
        offsets = np.cumsum([0] + [len(p[1]) for p in parts]).tolist()
        write_json(about, {"files": files, "content": content, "offsets": offsets})

    @staticmethod
    def _arrays(path):
        cells, labels, tokens = read_tokens(path)
        return (cells, labels, tokens, *read_owners(path, cells, labels))

    def balance(self, power):
        """for each grid, how likely its voxels are the middle of a set: frequency of the class to -power"""
        counts = np.bincount(self.labels, minlength=256).astype(np.float64)
        weights = np.where(counts > 0, np.maximum(counts, 1) ** -power, 0)
        sums = []
        for a, b in zip(self.offsets, self.offsets[1:]):
            w = np.cumsum(weights[self.labels[a:b]])
            sums.append(w / w[-1])
        return sums


def nearest(tree, middle, size):
    """numbers of the `size` points of a tree, whose coordinates are whole, that are nearest to point `middle`: i64
    [size], the nearest first, of equally far ones the lower number"""
    point = tree.data[middle]
    farthest = tree.query(point, [size])[0][0]
    near = np.array(tree.query_ball_point(point, farthest + 1e-6, return_sorted=True))  # with all as far as the last
    return near[((tree.data[near] - point) ** 2).sum(1).argsort(kind="stable")[:size]]


class LocalSets:
    """Batches of sets of neighbouring voxels: the `size` voxels that are nearest to one that is drawn."""

    def __init__(self, grids, config):
        self.grids, self.config = grids, config
        self.sums = grids.balance(config["class_balance"])
        self.trees = [cKDTree(grids.cells[a:b]) for a, b in zip(grids.offsets, grids.offsets[1:])]

    def batch(self, step, part=None):
        """of one size: centers [B, N, 3] metres, labels [B, N], tokens [B, N, 6n], known [B, N], conditions [B, N, W];
        fp64, i64, fp32, bool, fp32. Those of `part` alone, a range of the batch's sets, with the numbers that they have
        in the whole batch"""
        c = self.config
        part = range(c["batch"]) if part is None else part
        random = np.random.default_rng([c["seed"], step])
        size = int(random.integers(c["set_size"][0], c["set_size"][1] + 1))
        size = min(size, min(tree.n for tree in self.trees))
        drawn = [self._draw(self._example(random), size) for _ in range(c["batch"])]
        sets = [self._set(size, *drawn[i]) for i in part]
        centers, labels, tokens, cells, boxes, part_boxes = (np.stack(of_sets) for of_sets in zip(*sets))
        labels = labels.astype(np.int64)
        dropped = (random.random(c["batch"]) < c["label_dropout"])[part.start:part.stop]
        labels[dropped] = c["network"]["num_classes"]
        others = np.zeros((size, 3))  # which draw as many numbers wherever their voxels are
        known = [draw_known(random, centers[part.index(i)] if i in part else others, c["known_share"])
                 for i in range(part.stop)]
        conditions = np.stack([self._condition(np.random.default_rng([c["seed"], step, i]), *of_set)
                               for i, of_set in zip(part, zip(centers, cells, boxes, part_boxes, tokens, dropped))])
        return centers, labels, tokens, np.stack(known[part.start:]), conditions

    def _example(self, random):
        """random numbers of a set: of one of `examples`, where that is not 0"""
        count = self.config.get("examples", 0)
        return np.random.default_rng([self.config["seed"], 0, 0, int(random.integers(count))]) if count else random

    def _condition(self, random, centers, cells, boxes, part_boxes, tokens, dropped):
        """what a set is conditioned on beside its labels; where these are dropped, nothing. With all colours given,
        some things have others than in the grid: changes `tokens`"""
        owners, parts = self.grids.owners[cells], self.config["network"].get("condition", ())
        if dropped or not parts:
            return np.zeros((len(cells), width_of(parts)), np.float32)
        config = self.config["telling"]
        labels = self.grids.labels[cells]
        has_box, has_tint = given_boxes(random, owners, labels, config), given_tints(random, owners, config)
        local = self.grids.local_tints[cells] / 255
        whole = self.grids.tints[owners] if len(self.grids.tints) else local
        whole = np.where(np.isnan(whole), local, whole)
        if has_tint[owners >= 0].all():
            colors = tokens.reshape(len(tokens), -1, 6)[..., 3:]
            made, whole, local = repaint(random, config["repaint"], owners, labels, whole,
                                         (colors + 1) / 2, whole, local)
            colors[...] = 2 * made - 1
        tints = drawn_tints(random, owners, local, whole, config)
        boxes = drawn_boxes(random, owners, boxes, config)
        of_part = self._of_part(random, cells, part_boxes) if "part" in parts else None
        return vector_of(parts, centers, boxes, has_box, tints, has_tint, of_part)

    def _of_part(self, random, cells, boxes):
        """the last argument of vector_of, of a set"""
        parts, config = self.grids.parts[cells], self.config["telling"]
        config = {**config, "jitter": config["jitter"] / 3}  # windows are small: more would move them beside their places
        tints = self.grids.part_tints[parts] if len(self.grids.part_tints) else np.full((len(cells), 3), np.nan)
        has_part, has_tint = given_parts(random, parts, config), given_parts(random, parts, config)
        has_tint &= has_part & ~np.isnan(tints).any(1)
        tints = drawn_tints(random, parts, tints, tints, config)
        return drawn_boxes(random, parts, boxes, config), has_part, tints, has_tint

    def _draw(self, random, size):
        """of a set: which grid, where in its sums, whether x and y are turned over, an order of its points or None"""
        grid, place = int(random.integers(len(self.trees))), random.random()
        turned = [self.config["mirror"] and random.random() < 0.5 for _ in range(2)]
        points = (size, self.grids.tokens.shape[1] // 6)
        return grid, place, turned, None if self.config["ordered_points"] else random.random(points).argsort(1)

    def _set(self, size, g, place, turned, order):
        """-> centers, labels, tokens, which voxels of the grids these are, and the boxes of their objects and parts"""
        tree, first = self.trees[g], self.grids.offsets[g]
        chosen = nearest(tree, min(int(np.searchsorted(self.sums[g], place)), tree.n - 1), size)
        centers = (tree.data[chosen] + 0.5) * self.config["network"]["voxel_size"]
        tokens = self.grids.tokens[first + chosen].astype(np.float32).reshape(size, -1, 6)
        boxes, part_boxes = (of[numbers[first + chosen]] if len(of) else np.ones((size, 7))
                             for of, numbers in ((self.grids.boxes, self.grids.owners),
                                                 (self.grids.part_boxes, self.grids.parts)))
        for axis in np.flatnonzero(turned):  # streets mirrored in either direction are streets
            centers[:, axis] *= -1
            tokens[..., axis] *= -1
            boxes, part_boxes = mirrored(boxes, axis), mirrored(part_boxes, axis)
        if any(turned):  # points of a lattice are equally far from the centre: their order turns over, too
            tokens = np.take_along_axis(tokens, token_order(tokens), 1)
        if order is not None:
            tokens = np.take_along_axis(tokens, order[..., None], 1)
        return centers, self.grids.labels[first + chosen], tokens.reshape(size, -1), first + chosen, boxes, part_boxes

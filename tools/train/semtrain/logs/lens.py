# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Lenses, as the pixel of a ray (a, b, 1); pixel (c, r) covers [c, c+1) x [r, r+1). Pictures through them become those
of a pinhole without black borders."""
import math
from typing import NamedTuple

import numpy as np


class OpenCv(NamedTuple):
    """a pinhole, or with distortion k1 k2 p1 p2 k3 k4 k5 k6, of which the last may lack (docs/formats.md §7.2)"""
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple = ()

    def project(self, a, b):
        if any(self.distortion):
            k1, k2, p1, p2, k3, k4, k5, k6 = (*self.distortion, *(0,) * (8 - len(self.distortion)))
            s = a * a + b * b
            radial = (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
            a, b = (a * radial + 2 * p1 * a * b + p2 * (s + 2 * a * a),
                    b * radial + p1 * (s + 2 * b * b) + 2 * p2 * a * b)
        return self.fx * a + self.cx, self.fy * b + self.cy

    def pinhole(self, width, height):
        """that sees the middle of the picture, as much of it as has the proportions of width x height"""
        scale = max(width / self.width, height / self.height)
        return OpenCv(width, height, self.fx * scale, self.fy * scale, (self.cx - self.width / 2) * scale + width / 2,
                      (self.cy - self.height / 2) * scale + height / 2)


class Mei(NamedTuple):
    """a unit sphere seen from `xi` behind its middle, then radial and tangential distortion: Mei and Rives, Single View
    Point Omnidirectional Camera Calibration from Planar Grids, 2007"""
    width: int
    height: int
    xi: float
    k1: float
    k2: float
    p1: float
    p2: float
    gamma1: float
    gamma2: float
    u0: float
    v0: float

    def project(self, a, b):
        return self.of_direction(np.stack([a, b, np.ones_like(a)], -1))

    def of_direction(self, ray):
        """[..., 3], of any length, also from behind the camera"""
        x, y, z = np.moveaxis(ray / np.linalg.norm(ray, axis=-1, keepdims=True), -1, 0)
        lens = OpenCv(self.width, self.height, self.gamma1, self.gamma2, self.u0, self.v0,
                      (self.k1, self.k2, self.p1, self.p2))
        return lens.project(x / (z + self.xi), y / (z + self.xi))

    def pinhole(self, width, height):
        """of 90 degrees across, which looks along the axis"""
        return OpenCv(width, height, width / 2, width / 2, width / 2, height / 2)


def rays_of(pinhole, x, y):
    """pixel coordinates -> a, b"""
    return (x - pinhole.cx) / pinhole.fx, (y - pinhole.cy) / pinhole.fy


def _zoomed(pinhole, zoom):
    return pinhole._replace(fx=pinhole.fx * zoom, fy=pinhole.fy * zoom)


def _inside(lens, pinhole):
    """whether the border of the pinhole's picture lies in the lens'"""
    x, y = np.linspace(0, pinhole.width, 65), np.linspace(0, pinhole.height, 65)
    border = [(x, 0 * x), (x, 0 * x + pinhole.height), (0 * y, y), (0 * y + pinhole.width, y)]
    u, v = np.concatenate([lens.project(*rays_of(pinhole, *line)) for line in border], 1)
    slack = 1e-6 * lens.width
    return bool(((u >= -slack) & (u <= lens.width + slack) & (v >= -slack) & (v <= lens.height + slack)).all())


def target_of(lens, width, height):
    """the widest pinhole of that size, from the lens' own one on, whose picture has no black borders"""
    pinhole, least, most = lens.pinhole(width, height), 1.0, 1.0
    while not _inside(lens, _zoomed(pinhole, most)):
        least, most = most, most * 1.25
        if most > 100:
            raise SystemExit(f"a lens whose picture has no part of {width} x {height} pixels without borders: {lens}")
    for _ in range(20 if most > 1 else 0):
        middle = (least + most) / 2
        least, most = (least, middle) if _inside(lens, _zoomed(pinhole, middle)) else (middle, most)
    return _zoomed(pinhole, most)


class Undistortion:
    """from pictures through `lens` to those of the pinhole `target`"""

    def __init__(self, lens, width, height):
        self.lens, self.target = lens, target_of(lens, width, height)
        self.x, self.y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        self.u, self.v = lens.project(*rays_of(self.target, self.x, self.y))
        steps = [np.abs(np.diff(of, axis=axis)).max() for of, axis in ((self.u, 1), (self.v, 0))]
        count = min(8, max(1, math.ceil(max(steps) - 1e-3)))
        offsets = (np.arange(count) + 0.5) / count - 0.5
        self.parts = [self._bilinear(x, y) for y in offsets for x in offsets]

    def _bilinear(self, dx, dy):
        """of the points dx, dy from the pixels' centres: the first of four pixels, and how much the others count"""
        w, h = self.lens.width, self.lens.height
        u, v = self.lens.project(*rays_of(self.target, self.x + dx, self.y + dy))
        c, r = (np.clip(np.floor(of - 0.5), 0, side - 2).astype(np.int32) for of, side in ((u, w), (v, h)))
        right, down = (np.clip(of - 0.5 - at, 0, 1).astype(np.float32)[..., None] for of, at in ((u, c), (v, r)))
        return r * w + c, right, down

    def picture(self, pixels, where):
        """u8 [h, w, 3] -> u8 [H, W, 3]: bilinear, the mean of several points a pixel where it shrinks"""
        h, w = self.lens.height, self.lens.width
        if pixels.shape[:2] != (h, w):
            raise SystemExit(f"{where}: expected {w} x {h} pixels, as its lens is of, found {pixels.shape[1]} x "
                             f"{pixels.shape[0]}")
        flat, total = pixels.reshape(-1, 3).astype(np.float32), 0
        for first, right, down in self.parts:
            top = flat[first] * (1 - right) + flat[first + 1] * right
            bottom = flat[first + w] * (1 - right) + flat[first + w + 1] * right
            total = total + top * (1 - down) + bottom * down
        return (total / len(self.parts)).round().clip(0, 255).astype(np.uint8)

    def nearest(self, values):
        """[h, w] of any size, of the same view -> [H, W]"""
        h, w = values.shape
        column = np.clip(np.floor(self.u * w / self.lens.width), 0, w - 1).astype(int)
        row = np.clip(np.floor(self.v * h / self.lens.height), 0, h - 1).astype(int)
        return values[row, column]

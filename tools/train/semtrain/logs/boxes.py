# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Boxes of things, and which points and pixels those that move take away."""
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw
from scipy.spatial import ConvexHull, QhullError, cKDTree

from .motion import Motion, transformed

MOVES_FROM = 0.5            # metres from where a thing was first
LARGER, MARGIN = 1.05, 0.1  # a box is wider by 5 % and 0.1 m: people draw them tight, and things are not quite boxes
SAMPLES = 5                 # of a box while a sweep lasts
NEAR = 0.1                  # metres in front of a camera
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
EDGES = [(a, b) for a in range(8) for b in range(a) if np.abs(CORNERS[a] - CORNERS[b]).sum() == 1]


class Track(NamedTuple):
    """a thing: size along its x, y and z in metres, and where the middle of its box was, with axes along the box"""
    size: np.ndarray
    motion: Motion
    every: float  # seconds between annotations: it is known for as long before the first and after the last one

    def moves(self):
        places = self.motion.poses[:, :3, 3]
        return bool((np.linalg.norm(places - places[0], axis=1) > MOVES_FROM).any())

    def poses(self, times):
        """[N, 4, 4] at those of the times at which it is known"""
        first, last = self.motion.times[0] - self.every, self.motion.times[-1] + self.every
        known = [t for t in times if first <= t <= last]
        return self.motion.at(known) if known else np.empty((0, 4, 4))  # scipy has no empty list of rotations

    def half(self):
        return (self.size * LARGER + MARGIN) / 2


def track_of(seen, every):
    """seen: [(time, pose, size)] in any order -> Track"""
    seen = sorted(seen, key=lambda box: box[0])
    return Track(np.max([size for _, _, size in seen], 0),
                 Motion([time for time, _, _ in seen], [pose for _, pose, _ in seen]), every)


def moving_boxes(tracks, first, last):
    """-> [(pose, half its size)] of things that move, at times from `first` to `last`"""
    times = np.unique(np.linspace(first, last, SAMPLES))
    return [(pose, track.half()) for track in tracks for pose in track.poses(times)]


def in_boxes(points, boxes):
    """[N, 3] in the world -> bool [N]"""
    out = np.zeros(len(points), bool)
    if not boxes or not len(points):
        return out
    tree = cKDTree(points, balanced_tree=False)
    for pose, half in boxes:
        near = np.array(tree.query_ball_point(pose[:3, 3], np.linalg.norm(half)), int)
        own = (points[near] - pose[:3, 3]) @ pose[:3, :3]
        out[near] |= (np.abs(own) <= half).all(1)
    return out


def outline(camera_to_world, lens, pose, half):
    """[K, 2]: the convex hull of a box in a pinhole's picture, as far as it is in front of the camera; or None"""
    corners = transformed(np.linalg.inv(camera_to_world), transformed(pose, CORNERS * 2 * half))
    seen = list(corners[corners[:, 2] >= NEAR])
    for a, b in EDGES:
        if (corners[a, 2] < NEAR) != (corners[b, 2] < NEAR):
            share = (NEAR - corners[a, 2]) / (corners[b, 2] - corners[a, 2])
            seen.append(corners[a] + share * (corners[b] - corners[a]))
    if len(seen) < 3:
        return None
    seen = np.array(seen)
    pixels = np.stack(lens.project(seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2]), 1)
    try:
        return pixels[ConvexHull(pixels).vertices]
    except QhullError:  # seen from the edge: no area
        return None


def used_picture(camera_to_world, lens, boxes):
    """[H, W] u8: 0 where a box lies, 255 elsewhere"""
    picture = Image.new("L", (lens.width, lens.height), 255)
    for pose, half in boxes:
        hull = outline(camera_to_world, lens, pose, half)
        if hull is not None:
            bounded = np.clip(hull, -4 * max(picture.size), 5 * max(picture.size))
            ImageDraw.Draw(picture).polygon([tuple(p) for p in bounded - 0.5], fill=0, outline=0)
    return np.array(picture)

# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Poses, 4x4 matrices to the world, and what lies between them in time."""
import numpy as np
from scipy.spatial.transform import Rotation


def rigid(position, rotation):
    """rotation: a matrix, or a quaternion with w first"""
    out = np.eye(4)
    rotation = np.asarray(rotation, float)
    out[:3, :3] = rotation if rotation.ndim == 2 else Rotation.from_quat(rotation[[1, 2, 3, 0]]).as_matrix()
    out[:3, 3] = position
    return out


def transformed(pose, points):
    """[N, 3] -> [N, 3]; also with a pose a point [N, 4, 4]"""
    return np.einsum("...ij,...j->...i", pose[..., :3, :3], points) + pose[..., :3, 3]


class Motion:
    """poses at ascending times, seconds. Between two the position is linear and the rotation even; beyond the first and
    the last it goes on. A single pose stands."""

    def __init__(self, times, poses):
        self.times, self.poses = np.asarray(times, float), np.asarray(poses, float)

    def at(self, times):
        """[...] -> [..., 4, 4]"""
        times = np.asarray(times, float)
        if len(self.times) == 1:
            return np.broadcast_to(self.poses[0], (*times.shape, 4, 4)).copy()
        i = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        share = (times - self.times[i]) / (self.times[i + 1] - self.times[i])
        first, second = self.poses[i], self.poses[i + 1]
        turn = np.swapaxes(first[..., :3, :3], -1, -2) @ second[..., :3, :3]
        angles = Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec() * share.reshape(-1, 1)
        out = np.zeros((*times.shape, 4, 4))
        out[..., :3, :3] = first[..., :3, :3] @ Rotation.from_rotvec(angles).as_matrix().reshape(turn.shape)
        out[..., :3, 3] = first[..., :3, 3] + share[..., None] * (second[..., :3, 3] - first[..., :3, 3])
        out[..., 3, 3] = 1
        return out

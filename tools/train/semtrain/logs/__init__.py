# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Drives of PandaSet, nuScenes, KITTI-360 and InfiniCube, as pairs to train on (docs/logs.md)."""

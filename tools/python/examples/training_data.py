# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Drives on disk as a data set for PyTorch: training_data.py DRIVE..

Each DRIVE is a folder of `semrover render --instances --boxes`, or a shard set of one.
"""
import sys

import torch
from semrover.data import Drives


def sample(frame):
    """colour and depth as tensors that share the arrays' memory, and what is needed to place them"""
    color = torch.from_dlpack(frame.pictures["color"]).permute(2, 0, 1)
    depth = torch.from_dlpack(frame.pictures["depth"])
    label = torch.from_dlpack(frame.pictures["label"])
    return {"color": color.float() / 255, "depth": depth.float() / 1000, "label": label.long(),
            "camera_to_world": torch.from_numpy(frame.camera_to_world), "time_us": frame.time_us}


if __name__ == "__main__":
    drives = Drives(sys.argv[1:], kinds=("color", "depth", "label"), transform=sample)
    loader = torch.utils.data.DataLoader(drives, batch_size=4, shuffle=True, num_workers=2)
    for batch in loader:
        print(", ".join(f"{name} {list(value.shape)}" for name, value in batch.items()))

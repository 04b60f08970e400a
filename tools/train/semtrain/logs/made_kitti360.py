# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A rendered drive as a sequence of KITTI-360 (kitti360.py says where its layout is from). Its poses are half a turn of
the lidar apart: every other one is that of a frame, and the sweep that ends at the next one has the frame in its
middle. A panorama becomes the fisheye image_02."""
import os

import numpy as np
from PIL import Image

from .kitti360 import FIRST_PIXEL, MEI_FIELDS
from .label_table import LabelTable
from .lens import Mei
from .motion import Motion, rigid, transformed

START, FIRST = np.datetime64("2013-05-28T08:46:02.904000000"), 3  # time of the drive's begin, number of its first frame
BODY = np.diag([1.0, -1, -1, 1])                                  # x forward, y right, z down
RECTIFYING = rigid([0, 0, 0], [np.cos(0.005), 0, np.sin(0.005), 0])
SIDE = 280
FISHEYE = Mei(SIDE, SIDE, 2.2134, 0.016798, 1.65488, 4.2224e-4, 4.2462e-4, SIDE * 0.9545, SIDE * 0.9541, SIDE * 0.5121,
              SIDE * 0.5041)
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
KITTI_IDS = {"car": 13, "truck": 14, "bus": 34, "train": 33, "motorcycle": 17, "bicycle": 18, "person": 19, "rider": 20}


def write(drive, output, number):
    name = f"2013_05_28_drive_{number:04d}_sync"
    perspective = [c for c, (sensor, _) in drive.cameras.items() if sensor["model"] == "pinhole"][:2]
    panorama = [c for c, (sensor, _) in drive.cameras.items() if sensor["model"] == "equirectangular"][:1]
    if not perspective:
        raise SystemExit(f"{drive.folder}: no pinhole camera")
    scans = drive.scans[1::2]
    frames = [drive.scans[2 * i].time for i in range(len(scans))]
    for scan, time in zip(scans, frames):
        if abs(scan.time - scan.duration / 2 - time) > 1e-3:
            raise SystemExit(f"{drive.folder}: expected poses half a sweep ({scan.duration / 2:g} s) apart, found "
                             f"{scan.time - time:g} s")
    write_calibration(drive, perspective, panorama, os.path.join(output, "calibration"))
    for i, camera in enumerate(perspective + panorama):
        target = "image_02" if camera in panorama else f"image_0{i}"
        write_pictures(drive.cameras[camera], os.path.join(output, "{}", name, target), target, frames)
    write_clouds(scans, os.path.join(output, "data_3d_raw", name, "velodyne_points"), frames)
    write_boxes(drive.things, frames, os.path.join(output, "data_3d_bboxes", "train", name + ".xml"))
    poses = os.path.join(output, "data_poses", name)
    write_lines(os.path.join(poses, "poses.txt"),
                [f"{FIRST + i} {numbers((drive.poses[2 * i][1] @ BODY)[:3])}" for i in range(len(frames))])
    write_lines(os.path.join(poses, "cam0_to_world.txt"),
                [f"{FIRST + i} {numbers(drive.cameras[perspective[0]][1][2 * i].pose)}" for i in range(len(frames))])


def numbers(values):
    return " ".join(repr(float(v)) for v in np.ravel(values))


def write_lines(path, lines):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w") as file:
        file.writelines(line + "\n" for line in lines)


def write_times(folder, frames):
    """a line for each frame from 0 on, also of those before the drive"""
    every = np.timedelta64(100000000, "ns")
    times = [START - every * (FIRST - i) for i in range(FIRST)]
    times += [START + np.timedelta64(round(time * 1e9), "ns") for time in frames]
    write_lines(os.path.join(folder, "timestamps.txt"), [str(time).replace("T", " ") for time in times])


def write_calibration(drive, perspective, panorama, folder):
    body, lines = drive.poses[0][1] @ BODY, []
    to_body = {f"image_0{i}": np.linalg.inv(body) @ drive.cameras[c][1][0].pose @ RECTIFYING
               for i, c in enumerate(perspective)}
    if panorama:
        to_body["image_02"] = np.linalg.inv(body) @ drive.cameras[panorama[0]][1][0].pose
    write_lines(os.path.join(folder, "calib_cam_to_pose.txt"),
                [f"image_0{i}: {numbers(to_body.get(f'image_0{i}', np.eye(4))[:3])}" for i in range(4)])
    lidar = np.linalg.inv(BODY) @ drive.lidar_to_vehicle
    write_lines(os.path.join(folder, "calib_cam_to_velo.txt"),
                [numbers((np.linalg.inv(lidar) @ to_body["image_00"])[:3])])
    for i, c in enumerate(perspective):
        s = drive.cameras[c][0]
        rows = [[s["fx"], 0, s["cx"] - FIRST_PIXEL, 0], [0, s["fy"], s["cy"] - FIRST_PIXEL, 0], [0, 0, 1, 0]]
        lines += [f"S_rect_0{i}: {s['width']} {s['height']}", f"R_rect_0{i}: {numbers(RECTIFYING[:3, :3])}",
                  f"P_rect_0{i}: {numbers(rows)}"]
    write_lines(os.path.join(folder, "perspective.txt"), lines)
    if panorama:
        write_fisheye(os.path.join(folder, "image_02.yaml"))


def write_fisheye(path):
    value = {**FISHEYE._asdict(), "u0": FISHEYE.u0 - FIRST_PIXEL, "v0": FISHEYE.v0 - FIRST_PIXEL}
    groups = {"mirror": MEI_FIELDS[:1], "distortion": MEI_FIELDS[1:5], "projection": MEI_FIELDS[5:]}
    write_lines(path, ["%YAML:1.0", "---", "model_type: MEI", "camera_name: image_02", f"image_width: {SIDE}",
                       f"image_height: {SIDE}", *(
                           line for group, keys in groups.items() for line in
                           (f"{group}_parameters:", *(f"   {key}: {value[key]!r}" for key in keys)))])


def write_pictures(camera, pattern, name, times):
    sensor, frames = camera
    raw = pattern.format("data_2d_raw")
    rectified = os.path.join(raw, "data_rgb" if name == "image_02" else "data_rect")
    semantic = os.path.join(pattern.format("data_2d_semantics/train"), "semantic")
    table = LabelTable("kitti360").first_numbers(0)
    for folder in (rectified, *([] if name == "image_02" else [semantic])):
        os.makedirs(folder)
    for i in range(len(times)):
        file, frame = f"{FIRST + i:010d}.png", frames[2 * i]
        picture = np.array(Image.open(frame.color).convert("RGB"))
        picture = picture if name != "image_02" else fisheye_of(picture, sensor)
        Image.fromarray(picture).save(os.path.join(rectified, file))
        if name != "image_02":
            Image.fromarray(table[np.array(Image.open(frame.label))]).save(os.path.join(semantic, file))
    write_times(raw, times)


def directions_of(lens):
    """[h, w, 3] of the pixels' centres, NaN where no ray leads; the distortion is taken back by repeated guesses"""
    x, y = np.meshgrid((np.arange(lens.width) + 0.5 - lens.u0) / lens.gamma1,
                       (np.arange(lens.height) + 0.5 - lens.v0) / lens.gamma2)
    a, b = x, y
    for _ in range(30):
        s = a * a + b * b
        radial = 1 + lens.k1 * s + lens.k2 * s * s
        a, b = ((x - 2 * lens.p1 * a * b - lens.p2 * (s + 2 * a * a)) / radial,
                (y - lens.p1 * (s + 2 * b * b) - 2 * lens.p2 * a * b) / radial)
    s = a * a + b * b
    with np.errstate(invalid="ignore"):
        eta = (lens.xi + np.sqrt(1 + (1 - lens.xi ** 2) * s)) / (s + 1)
    return np.stack([eta * a, eta * b, eta - lens.xi], -1)


def fisheye_of(panorama, sensor):
    """u8 [h, w, 3] of an equirectangular sensor -> through FISHEYE; black where the fisheye sees nothing"""
    ray = directions_of(FISHEYE)
    u = sensor["width"] * (0.5 + np.arctan2(ray[..., 0], ray[..., 2]) / (2 * np.pi)) - 0.5
    v = sensor["height"] * (0.5 + np.arcsin(np.clip(ray[..., 1], -1, 1)) / np.pi) - 0.5
    seen = np.isfinite(u) & np.isfinite(v)
    u, v = np.where(seen, u, 0), np.clip(np.where(seen, v, 0), 0, sensor["height"] - 1)
    c, r = np.floor(u).astype(int), np.minimum(np.floor(v).astype(int), sensor["height"] - 2)
    right, down = (u - c)[..., None], (v - r)[..., None]

    def at(i, j):
        return panorama[r + i, (c + j) % sensor["width"]].astype(float)

    out = (at(0, 0) * (1 - right) + at(0, 1) * right) * (1 - down) + (at(1, 0) * (1 - right) + at(1, 1) * right) * down
    return np.where(seen[..., None], out.round(), 0).astype(np.uint8)


def write_clouds(scans, folder, frames):
    """as the lidar saw them, which moved meanwhile"""
    os.makedirs(os.path.join(folder, "data"))
    for i, scan in enumerate(scans):
        p = scan.points().astype(float)
        moving = Motion([0, 1], [scan.begin, scan.end]).at(p[:, 5] * 1e-6 / scan.duration)
        raw = transformed(np.linalg.inv(moving), transformed(scan.end, p[:, :3]))
        np.column_stack([raw, p[:, 3]]).astype(np.float32).tofile(os.path.join(folder, "data", f"{FIRST + i:010d}.bin"))
    write_times(folder, frames)


def write_boxes(things, frames, path):
    """of what moves a box a frame; of what stands one, of the time -1"""
    nodes = []
    for thing, (name, size, boxes) in things.items():
        if name not in KITTI_IDS:
            continue
        moves = any(np.abs(box.pose[:3, 3] - boxes[0].pose[:3, 3]).max() > 0.01 for box in boxes)
        for box in boxes if moves else boxes[:1]:
            frame = next((i for i, time in enumerate(frames) if abs(time - box.time) < 1e-6), None)
            if frame is not None or not moves:
                nodes.append(node(len(nodes), thing, name, size, box.pose, FIRST + frame if moves else -1, len(frames)))
    write_lines(path, ['<?xml version="1.0"?>', "<opencv_storage>", *nodes, "</opencv_storage>"])


def node(index, thing, name, size, pose, time, frames):
    transform = pose @ np.diag([*size, 1])
    return "\n".join([
        f"<object{index + 1}>", f"  <index>{index}</index>", f"  <label>{name}</label>",
        f"  <semanticId>{KITTI_IDS[name]}</semanticId>", f"  <instanceId>{thing}</instanceId>",
        f"  <timestamp>{time}</timestamp>", f"  <dynamic>{int(time >= 0)}</dynamic>",
        f"  <start_frame>{FIRST}</start_frame>", f"  <end_frame>{FIRST + frames - 1}</end_frame>",
        matrix("transform", transform), matrix("vertices", CORNERS), f"</object{index + 1}>"])


def matrix(name, values):
    return (f'  <{name} type_id="opencv-matrix"><rows>{values.shape[0]}</rows><cols>{values.shape[1]}</cols><dt>d</dt>'
            f"<data>{numbers(values)}</data></{name}>")

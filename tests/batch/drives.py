"""Drives with poses and masks for runs: small ones made up, and a simulated one."""

import json

import numpy as np

from datasets import layouts

STEP_M = 0.3


def pose(number):
    """T_world_lidar of a frame."""
    made = np.eye(4)
    made[0, 3] = STEP_M * number
    return made


def small_drive(folder, n_frames=8, *, period_s=0.1, poses=True):
    """KITTI's odometry layout: clouds of one world, from a lidar that drives ahead, and two masks a frame."""
    sequence = folder / "sequences/08"
    layouts.write_text(sequence / "calib.txt", f"P2: {layouts.row(layouts.P)}\nTr: {layouts.row(layouts.T[:3])}\n")
    layouts.write_text(sequence / "times.txt", "".join(f"{period_s * k:e}\n" for k in range(n_frames)))
    if poses:
        layouts.write_text(sequence / "poses.txt", kitti_poses(n_frames))
    generator = np.random.default_rng(5)
    for number in range(n_frames):
        points = np.ones((200, 4), "<f4")
        points[:, :3] = generator.uniform([8, -4, -2], [14, 4, 2], (200, 3))
        name = f"{number:06d}"
        layouts.write_points(sequence / f"velodyne/{name}.bin", points)
        layouts.write_image(sequence / f"image_2/{name}.png")
        layouts.write_text(sequence / f"masks/{name}.json", json.dumps(layouts.coco(20 + number % 3)))
    return sequence


def kitti_poses(n_frames, step=1.0):
    of_camera = (layouts.T @ pose(step * k) @ np.linalg.inv(layouts.T) for k in range(n_frames))
    return "".join(f"{layouts.row(each[:3])}\n" for each in of_camera)


def tum_poses(n_frames, *, period_s=0.1, step=1.0):
    return "".join(f"{period_s * k:.6f} {STEP_M * k * step:.6f} 0 0 0 0 0 1\n" for k in range(n_frames))

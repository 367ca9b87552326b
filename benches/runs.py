"""A folder of many frames in KITTI's object layout: one frame, over and over."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

import ldls
from benches.frames import Frame


def write_frames(folder: Path, frame: Frame, count: int) -> tuple[Path, Path]:
    """Write `count` frames; the folders of the frames and of their masks."""
    height, width = frame.masks.image_size
    training, masks = folder / "training", folder / "masks"
    for name in ("velodyne", "calib", "image_2"):
        (training / name).mkdir(parents=True)
    masks.mkdir()
    first = {
        training / "velodyne": ".bin",
        training / "calib": ".txt",
        training / "image_2": ".png",
        masks: ".json",
    }
    paths = {parent: folder / f"frame{suffix}" for parent, suffix in first.items()}
    np.ascontiguousarray(frame.points[:, :4], "<f4").tofile(paths[training / "velodyne"])
    rows = {
        "P2": frame.camera.projection,
        "R0_rect": np.eye(3),
        "Tr_velo_to_cam": frame.camera.T_camera_lidar[:3],
    }
    lines = (f"{key}: {' '.join(map(repr, matrix.ravel().tolist()))}\n" for key, matrix in rows.items())
    paths[training / "calib"].write_text("".join(lines))
    Image.new("RGB", (width, height)).save(paths[training / "image_2"])
    ldls.save(frame.masks, paths[masks])
    for parent, path in paths.items():
        for number in range(count):
            (parent / f"{number:06d}{path.suffix}").symlink_to(path)
    return training, masks


def loop(frame: Frame, count: int, params: ldls.Params) -> None:
    """Segment the frame `count` times, as one worker would."""
    diffusion = ldls.LabelDiffusion(frame.camera, params)
    for _ in range(count):
        diffusion.segment(frame.points, frame.masks)

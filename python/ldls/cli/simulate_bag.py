"""The part of `ldls simulate` that writes ROS bags."""

from __future__ import annotations

from pathlib import Path

from ldls.cli.messages import console


def write_bag(out: Path, kind: str, *, frames: int, seed: int, errors: bool) -> None:
    """Write the bag of a robot's drive, and say where it is."""
    from ldls.simulation import SegmenterErrors, write_robot_drive

    segmenter = SegmenterErrors() if errors else SegmenterErrors.none()
    screen = console()
    with screen.status("simulating"):
        path = write_robot_drive(out, kind, frames=frames, seed=seed, segmenter=segmenter)
    screen.print(f"wrote {frames} sweeps to {path}, masks and annotations beside it", highlight=False, soft_wrap=True)

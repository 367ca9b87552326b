"""`ldls simulate`: scenes with perfect labels, as files."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from ldls.cli.messages import console, say_kept, speaks_plainly
from ldls.cli.options import CoresOption, SuitePart
from ldls.cli.progress import progress
from ldls.errors import ParameterError

if TYPE_CHECKING:
    from ldls.simulation import FrameSummary, SegmenterErrors


class SceneKind(StrEnum):
    """Kinds of scenes."""

    STREET = "street"
    CAMPUS = "campus"


class LidarName(StrEnum):
    """Lidars."""

    HDL_64E = "hdl-64e"
    HDL_32E = "hdl-32e"
    VLP_16 = "vlp-16"
    OS1_128 = "os1-128"


class Rig(StrEnum):
    """Sets of cameras."""

    KITTI = "kitti"
    ROBOT = "robot"
    RING = "ring"


class Layout(StrEnum):
    """Layouts of the files."""

    KITTI = "kitti"
    KITTI_RAW = "kitti-raw"
    ROSBAG1 = "rosbag1"
    ROSBAG2 = "rosbag2"
    MCAP = "mcap"


@speaks_plainly
def simulate(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="Folder for the frames; made if need be.", file_okay=False)
    ],
    count: Annotated[int, typer.Option(metavar="N", min=1, help="Number of frames.")] = 20,
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="Seed of the first frame; each next frame has the next seed.")
    ] = 0,
    scene: Annotated[
        SceneKind, typer.Option(metavar="|".join(SceneKind), help="Kind of the scenes.")
    ] = SceneKind.STREET,
    # a narrow terminal breaks choices between blanks, or else within words
    lidar: Annotated[
        LidarName, typer.Option(metavar=" | ".join(LidarName), help="Beam table, ranges and noise of the sweep.")
    ] = LidarName.HDL_64E,
    rig: Annotated[
        Rig,
        typer.Option(
            metavar="|".join(Rig),
            help="KITTI's 375 x 1242 (height x width), a robot's 480 x 640, or a ring of six of 900 x 1600.",
        ),
    ] = Rig.KITTI,
    layout: Annotated[
        Layout,
        typer.Option(
            metavar=" | ".join(Layout),
            help="Single scenes as KITTI's object data, a drive through a scene as KITTI's raw data, or a robot's "
            "drive through a campus as a ROS bag; --scene, --lidar, --rig and --cores then do not count.",
        ),
    ] = Layout.KITTI,
    suite: Annotated[
        SuitePart | None,
        typer.Option(
            metavar="|".join(SuitePart),
            help="Write this part of the suite (200 or 20 fixed frames); the options above then do not count.",
        ),
    ] = None,
    errors: Annotated[
        bool,
        typer.Option("--errors/--no-errors", help="Masks, calibration and clocks wrong as in life, or perfect."),
    ] = True,
    spinning: Annotated[
        bool,
        typer.Option(
            "--spinning",
            help="In a drive, the lidar takes 0.1 s for a sweep, while it and all objects move; otherwise all stands "
            "still during a sweep.",
        ),
    ] = False,
    cores: CoresOption = None,
) -> None:
    """Make scenes with perfect labels: streets and campuses, seen by a lidar and a camera.

    Writes KITTI's object layout to OUT/training: velodyne (points), image_2, calib, label_2 (boxes), masks (COCO
    JSON: what a segmenter would find) and annotations (`instance class`, a line a point, `0 background` for none).
    A ring's other cameras go to image_ring_1 to image_ring_5, with calib_ring_K and masks_ring_K.

    With --layout kitti-raw the frames are a drive, ten a second, through the scene of the seed: folder
    DATE/DATE_drive_NNNN_sync with velodyne_points, image_02, masks_02, annotations and oxts (poses); the calibration
    is in DATE. With --spinning, points have the coordinates of the lidar at their own time, in which it turns
    clockwise from timestamps_start.txt to timestamps_end.txt of velodyne_points.

    A seed is a frame, or a drive: the same one gives the same files. Frames that are there already are kept, and those
    made of something else refused; a drive goes on only where it is the same one. Needs the extra `sim` of ldls.

    With --layout rosbag1, rosbag2 (SQLite) or mcap, OUT holds a bag of the VLP-16 and the camera of a robot, ten
    frames a second, and masks (of the right categories) and annotations named by stamp. With --spinning, points have a
    time, in seconds since the stamp. Needs the extra `ros` too.

    Example: ldls simulate scenes --count 5 --scene campus, and then ldls segment
    --points scenes/training/velodyne/000000.bin --calib scenes/training/calib/000000.txt
    --masks scenes/training/masks/000000.json --out results
    """
    from ldls._ldls import default_threads
    from ldls.simulation import (
        Drive,
        FrameOrder,
        SegmenterErrors,
        SensorErrors,
        drive_folder,
        make_frames,
        suite_orders,
        write_drive,
    )

    if suite and layout is not Layout.KITTI:
        raise ParameterError(f"--suite: the suite is in KITTI's layout; use --count with --layout {layout.value}")
    if suite and not errors:
        raise ParameterError("--no-errors: the suite's errors are part of it; use --count and --seed without --suite")
    if spinning and layout is Layout.KITTI:
        raise ParameterError("--spinning: single scenes are of one instant; use --layout kitti-raw, or that of a bag")
    processes = cores or default_threads()
    segmenter = SegmenterErrors() if errors else SegmenterErrors.none()
    sensors = SensorErrors() if errors else SensorErrors.none()
    if layout is Layout.KITTI_RAW:
        drive = Drive(
            n_frames=count,
            seed=seed,
            kind=scene.value,
            lidar=lidar.value,
            camera=rig.value,
            segmenter=segmenter,
            sensors=sensors,
            spinning=spinning,
        )
        _follow(write_drive(out, drive, processes=processes), count, drive_folder(out, drive))
    elif layout is Layout.KITTI:
        orders = [
            FrameOrder(
                name=f"{number:06d}",
                seed=seed + number,
                kind=scene.value,
                lidar=lidar.value,
                camera=rig.value,
                segmenter=segmenter,
                sensors=sensors,
            )
            for number in range(count)
        ]
        if suite:
            orders = suite_orders(suite.value)
        _follow(make_frames(out, orders, processes=processes), len(orders), out / "training")
    else:
        _write_bag(out, layout, count, seed, None if errors else segmenter, spinning=spinning)


def summary_table(made: list[FrameSummary]) -> Table:
    """Objects with points and their points, by category, over all frames."""
    from ldls.io.masks.kitti_boxes import KITTI_NAMES

    points, objects = sum(s.points for s in made), sum(sum(s.objects.values()) for s in made)
    masks, labelled = sum(s.masks for s in made), sum(sum(s.object_points.values()) for s in made)
    title = f"{len(made)} frames, {points:,} points, {masks:,} masks"
    table = Table(title=title, show_footer=True)
    table.add_column("category", footer="all")
    table.add_column("objects", justify="right", footer=f"{objects:,}")
    table.add_column("points", justify="right", footer=f"{labelled:,}")
    for category in sorted({c for s in made for c in s.objects}):
        count = sum(s.objects.get(category, 0) for s in made)
        table.add_row(KITTI_NAMES[category], f"{count:,}", f"{sum(s.object_points.get(category, 0) for s in made):,}")
    return table


def _follow(frames: Iterator[FrameSummary | None], total: int, where: Path) -> None:
    """Wait for frames that are made, and print what they hold."""
    screen = console()
    summaries = list(progress(frames, total, "simulating"))
    made = [s for s in summaries if s is not None]
    if made:
        screen.print(summary_table(made))
    screen.print(f"wrote {len(made)} frames to {where}", soft_wrap=True)
    say_kept(len(summaries) - len(made))


def _write_bag(
    out: Path, layout: Layout, frames: int, seed: int, segmenter: SegmenterErrors | None, *, spinning: bool
) -> None:
    from ldls.simulation import write_robot_drive

    screen = console()
    with screen.status("simulating"):
        path = write_robot_drive(out, layout.value, frames=frames, seed=seed, segmenter=segmenter, spinning=spinning)
    screen.print(f"wrote {frames} sweeps to {path}, masks and annotations beside it", soft_wrap=True)

"""The files of one frame, as commands take them: a lidar sweep, a calibration and instance masks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from ldls.camera import Camera

EXISTING: dict[str, Any] = {"exists": True, "dir_okay": False, "readable": True}
POINTS = typer.Option(
    metavar="FILE",
    help="Lidar sweep: .bin, .npy, .pcd, .ply, .las, .laz, or text (.csv, .txt, .xyz, .asc, .pts).",
    **EXISTING,
)
ColumnsOption = Annotated[
    int | None,
    typer.Option(metavar="N", help="Floats a row of a .bin sweep.", show_default="4, and 5 for .pcd.bin"),
]
CALIB = typer.Option(
    metavar="PATH",
    help="Calibration of the camera: KITTI's (of KITTI raw the folder of the day), OpenCV's (YAML or XML), ROS's or "
    "Kalibr's.",
    **(EXISTING | {"dir_okay": True}),
)
MASKS = typer.Option(
    metavar="PATH",
    help="Instance masks: .json of COCO, labelme or Segment Anything, .txt of YOLO's polygons or KITTI's boxes, "
    "instance .png, .npz of ldls or the LDLS research code, .npy stack, or a folder of one .png an instance.",
    show_default=False,
    **(EXISTING | {"dir_okay": True}),
)
IMAGE_ID = typer.Option(metavar="ID", help="Which image of a COCO file that holds several: its id, number or text.")
ExtrinsicOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Where the lidar is, for a calibration that does not say: 12 or 16 numbers of T_camera_lidar by rows, or "
        "YAML, JSON or TOML with translation, quaternion_xyzw (or quaternion_wxyz, roll_pitch_yaw_deg, rotation) and "
        "pose_of: camera, the camera's pose in the lidar frame, or lidar, the other way round.",
        show_default=False,
        **EXISTING,
    ),
]
FisheyeOption = Annotated[
    bool | None,
    typer.Option(
        "--fisheye/--no-fisheye",
        help="Whether coefficients of OpenCV are those of cv2.fisheye, where the file does not say.",
        show_default=False,
    ),
]
RectifiedOption = Annotated[
    bool | None,
    typer.Option(
        "--rectified/--raw",
        help="Whether masks are of the rectified image of a CameraInfo, or of the raw one.",
        show_default=False,
    ),
]


def camera_of(
    calib: Path,
    *,
    camera: str | None,
    extrinsic: Path | None,
    fisheye: bool | None,
    rectified: bool | None,
) -> tuple[Camera, str]:
    """The camera of a calibration file, by the words of a command line, and its name."""
    from ldls.io import read_camera

    seen_by = read_camera(calib, camera=_which(camera), T_camera_lidar=extrinsic, fisheye=fisheye, rectified=rectified)
    return seen_by, camera_name(calib, camera)


def camera_name(calib: Path, camera: str | None) -> str:
    """Name of the camera that `camera_of` reads: of KITTI's the folder of its images, empty where nothing names it."""
    from ldls.io.cameras.kitti import camera_numbers
    from ldls.io.cameras.read import is_kitti

    which = _which(camera)
    if is_kitti(calib):
        [name] = camera_numbers(which if isinstance(which, int) else 2, digits=2 if calib.is_dir() else 1)
        return name
    return f"camera {which}" if isinstance(which, int) else which or ""


def _which(camera: str | None) -> int | str | None:
    """The number of a camera that is called by it, or as the folder of its images is in KITTI, or the name."""
    number = (camera or "").removeprefix("image_")
    return int(number) if number.isdecimal() else camera

"""`ldls segment`: one frame from files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from ldls.cli.frame_files import (
    CALIB,
    EXISTING,
    IMAGE_ID,
    MASKS,
    POINTS,
    ColumnsOption,
    ExtrinsicOption,
    FisheyeOption,
    RectifiedOption,
    camera_of,
)
from ldls.cli.mask_options import SEGMENTER, CategoriesOption, MinScoreOption, masks_of
from ldls.cli.messages import console, object_table, speaks_plainly, timing_table
from ldls.cli.method_options import takes_params
from ldls.cli.options import CoresOption, FormatsOption, ObjectsOption, OutOption, PictureOption, words
from ldls.cli.recording_options import (
    DiffusionOption,
    RerunOption,
    check_recording,
    record,
    recording_files,
)
from ldls.errors import LdlsError, ParameterError
from ldls.params import Params


@speaks_plainly
@takes_params
def segment(
    *,
    points: Annotated[Path, POINTS],
    calib: Annotated[Path, CALIB],
    out: OutOption,
    columns: ColumnsOption = None,
    masks: Annotated[Path | None, MASKS] = None,
    segmenter: Annotated[str | None, SEGMENTER] = None,
    image: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Image for the segmenter, and to draw the picture on.", show_default=False, **EXISTING
        ),
    ] = None,
    min_score: MinScoreOption = None,
    categories: CategoriesOption = None,
    save_masks: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="File for the masks, for --masks of another run: .json, .npz or .png.", dir_okay=False
        ),
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Which camera of the calibration: 0 to 3 of KITTI, cam0 and so on of Kalibr, 1 or 2 of a stereo pair.",
            show_default="2, KITTI's left colour one; the first of others",
        ),
    ] = None,
    extrinsic: ExtrinsicOption = None,
    fisheye: FisheyeOption = None,
    rectified: RectifiedOption = None,
    image_id: Annotated[str | None, IMAGE_ID] = None,
    formats: FormatsOption = "npz,label,ply,png",
    objects: ObjectsOption = None,
    picture: PictureOption = None,
    cores: CoresOption = None,
    rerun: RerunOption = None,
    diffusion: DiffusionOption = None,
    params: Params,
) -> None:
    """Label the points of one lidar sweep by the instance masks of one image.

    Prints the objects found and the time of each stage, and writes to the folder --out, named after the sweep:
    .npz (all fields), .label (SemanticKITTI), .ply (coloured cloud) and .png (picture), or what --formats says.

    Masks come from a file (--masks) or from a segmenter that runs on the image (--segmenter); KITTI's 2D boxes are
    enough to begin with.

    Examples:
    ldls segment --points velodyne/000571.bin --calib calib/000571.txt --image image_2/000571.png
    --masks masks/000571.json --out results

    ldls segment --points velodyne/000001.bin --calib calib/000001.txt --image image_2/000001.png
    --segmenter boxes:label_2/000001.txt --out results

    ldls segment --points sweep.pcd --calib camera.yaml --extrinsic lidar.yaml --image image.png --masks masks.json
    --out results
    """
    from ldls.io import read_image, read_points, save
    from ldls.io.files import check_outputs, make_folder
    from ldls.io.objects import FrameObjects, objects_writer
    from ldls.label_diffusion import segment as label_points
    from ldls.segmenters.registry import segmenter_file
    from ldls.view import View, camera_names
    from ldls.viewing.files import check_picture, picture_files, save_pictures
    from ldls.viewing.formats import PICTURE, check_formats, file_name, write_formats

    check_recording(rerun, diffusion)
    wanted = tuple(dict.fromkeys(words(formats)))
    check_formats(wanted)
    check_picture(picture)
    write_objects = None if objects is None else objects_writer(objects)
    name = points.stem.removesuffix(".pcd")
    outputs: dict[str, Sequence[Path | None]] = {
        "--out": [out / file_name(name, word) for word in wanted],
        "--save-masks": [save_masks],
        "--objects": [objects],
        "--picture": picture_files(picture),
        "--rerun": recording_files(rerun),
    }
    check_outputs(outputs, [points, calib, extrinsic, masks, segmenter_file(segmenter), image], made=out)
    pixels = None if image is None else read_image(image)
    seen_by, called = camera_of(calib, camera=camera, extrinsic=extrinsic, fisheye=fisheye, rectified=rectified)
    # before a segmenter, which takes long
    cloud = read_points(points, columns=columns)
    chosen = masks_of(
        pixels,
        masks=masks,
        segmenter=segmenter,
        image_id=image_id,
        image_size=seen_by.image_size,
        min_score=min_score,
        categories=categories,
    )
    drawn = out / file_name(name, PICTURE)
    if PICTURE in wanted and _is_photo(drawn, chosen.image_size):
        raise ParameterError(f"--out: would write over {drawn}, which seems to be the camera's image; give another")
    result = label_points(cloud, [View(chosen, seen_by, called)], params=replace(params, threads=cores))
    make_folder(out)
    if save_masks is not None:
        save(chosen, save_masks)
    written = write_formats(result, out, name, wanted, [pixels])
    if write_objects is not None and objects is not None:
        write_objects([FrameObjects.of(name, result)])
        written.append(objects)
    if picture is not None:
        written += save_pictures(picture, result, pixels)
    screen = console()
    screen.print(object_table(result.objects))
    screen.print(timing_table(result.timings))
    report = result.report
    screen.print(f"{report.n_in_view:,} of {report.n_points:,} points in view")
    if report.n_nonfinite:
        screen.print(f"{report.n_nonfinite:,} points are not finite and were left out")
    screen.print("wrote " + " ".join(map(str, written)), soft_wrap=True)
    if rerun is not None:
        pictures = None if pixels is None else {camera_names(result.views)[0]: pixels}
        screen.print(record(result, rerun, name=name, images=pictures, diffusion=diffusion), soft_wrap=True)


def _is_photo(path: Path, image_size: tuple[int, int]) -> bool:
    """True for what is the camera's image by its (height, width), and by its width no picture of `overlay`.

    It often has the name of the sweep, which the picture would have too.
    """
    from ldls.io.images import read_image_size
    from ldls.viewing.overlay import usual_width_px

    try:
        return read_image_size(path) == image_size and image_size[1] != usual_width_px(*image_size)
    except (LdlsError, FileNotFoundError):
        return False

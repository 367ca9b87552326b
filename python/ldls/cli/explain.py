"""`ldls explain`: why a point has its label."""

from __future__ import annotations

import json
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
from ldls.cli.messages import console, speaks_plainly
from ldls.cli.options import refuse
from ldls.errors import InputError


def as_argument(word: str) -> str:
    """`word`, unless it is an option: the command takes what it does not know for arguments, as -3.2,1,0.5 is one.

    Raises:
        typer.BadParameter: It is an option.
    """
    if word.startswith("-") and not word[1:2].isdigit() and not word.startswith("-."):
        raise typer.BadParameter(f"no such option: {word}")
    return word


@speaks_plainly
def explain(
    point: Annotated[
        str,
        typer.Argument(
            metavar="POINT",
            help="Row number in the cloud, from 0; or U,V, a pixel of the image, or of the picture --on; or "
            "X,Y,Z in metres in the lidar frame. Of a pixel or a place, the nearest point is taken.",
            callback=as_argument,
        ),
    ],
    result: Annotated[
        Path | None,
        typer.Argument(metavar="RESULT", help="An .npz file of ldls.", show_default=False, **EXISTING),
    ] = None,
    points: Annotated[Path | None, POINTS] = None,
    columns: ColumnsOption = None,
    calib: Annotated[Path | None, CALIB] = None,
    masks: Annotated[Path | None, MASKS] = None,
    camera: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Whose pixel U,V is, by name or number from 0, in a result of several cameras. With --calib: which "
            "camera of the calibration, as of ldls segment.",
            show_default=False,
        ),
    ] = None,
    on: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png",
            help="Picture that ldls drew of the result, whose pixel U,V is: results/000571.png.",
            show_default=False,
            **EXISTING,
        ),
    ] = None,
    extrinsic: ExtrinsicOption = None,
    fisheye: FisheyeOption = None,
    rectified: RectifiedOption = None,
    image_id: Annotated[str | None, IMAGE_ID] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")] = False,
) -> None:
    """Say why a point has its label.

    The first line is the verdict. Then come what each camera sees of the point (its pixel, what masks cover the window
    around it, and which of them count for a point so far away), the likelihood of every label, the edges over which
    labels flow to it, and, for a point of an object, the connected components of which outlier removal keeps the
    largest and parts near it. Points out of view get a reason.

    The point is one of a result that ldls wrote (.npz), or of a sweep that is segmented on the spot with the best known
    parameters. Needs the extra eval.

    Examples:
    ldls explain 12345 results/000571.npz

    ldls explain 610,180 results/000571.npz

    ldls explain 884,260 results/000571.npz --on results/000571.png

    ldls explain 12.5,-3,0.2 --points velodyne/000571.bin --calib calib/000571.txt --masks masks/000571.json
    """
    from ldls.cli.chosen_point import chosen_point
    from ldls.cli.mask_options import masks_of
    from ldls.explaining import explain as explain_point
    from ldls.io import read_points, read_result
    from ldls.label_diffusion import segment
    from ldls.view import View

    if result is not None:
        of_sweep = {
            "points": points,
            "columns": columns,
            "calib": calib,
            "masks": masks,
            "image-id": image_id,
            "extrinsic": extrinsic,
            "fisheye": fisheye,
            "rectified": rectified,
        }
        refuse(of_sweep, "given beside RESULT, which has points, camera and masks")
        segmentation, view = read_result(result), camera
    else:
        if points is None or calib is None or masks is None:
            raise InputError("RESULT: missing; give an .npz file of ldls, or --points, --calib and --masks, all three")
        seen_by, called = camera_of(calib, camera=camera, extrinsic=extrinsic, fisheye=fisheye, rectified=rectified)
        instances = masks_of(None, masks=masks, segmenter=None, image_id=image_id, image_size=seen_by.image_size)
        segmentation, view = segment(read_points(points, columns=columns), [View(instances, seen_by, called)]), None
    chosen = chosen_point(point, segmentation, view, on)
    explanation = explain_point(segmentation, chosen.row)
    if as_json:
        typer.echo(json.dumps(explanation.to_dict(), allow_nan=False, indent=2, ensure_ascii=False))
        return
    from ldls.cli.explanation_tables import tables_of

    screen = console()
    for part in (explanation.verdict, chosen.how, *tables_of(explanation)):
        if part:
            # a program that reads the sentences gets each as one line
            one_line = isinstance(part, str) and not screen.is_terminal
            screen.print(part, soft_wrap=one_line)

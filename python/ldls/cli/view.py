"""`ldls view`: a result, or the frames of a source, in the Rerun viewer or as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from ldls.cli.mask_options import CategoriesOption, FrameSegmenterOption, MinScoreOption
from ldls.cli.messages import console, speaks_plainly
from ldls.cli.options import FRAMES_FAILED, PictureOption, refuse
from ldls.cli.recording_options import (
    DiffusionOption,
    check_recording,
    default_target,
    record,
    recording_files,
    where_recorded,
)
from ldls.cli.source_options import DatasetOption, SourceOption, StoredMasksOption
from ldls.cli.view_source import MOST_FRAMES, chosen_frames, labelled, show_frames
from ldls.errors import InputError


@speaks_plainly
def view(
    path: Annotated[
        Path,
        typer.Argument(metavar="RESULT|SOURCE", help="An .npz that ldls wrote, or whatever `ldls info` takes."),
    ],
    image: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[CAMERA=]FILE",
            help="Image of a RESULT; of several cameras by their names, or one for each in their order.",
            show_default=False,
        ),
    ] = None,
    dataset: DatasetOption = None,
    option: SourceOption = None,
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="START:STOP:STEP", help="Which frames, from 0: 100:500:5.", show_default=f"the first {MOST_FRAMES}"
        ),
    ] = None,
    masks: StoredMasksOption = None,
    segmenter: FrameSegmenterOption = None,
    min_score: MinScoreOption = None,
    categories: CategoriesOption = None,
    results: Annotated[
        Path | None,
        typer.Option(
            help="Folder of an earlier `ldls run --formats npz`, or tracks in it: its results are shown, nothing is "
            "segmented.",
            metavar="FOLDER",
            exists=True,
            file_okay=False,
            show_default=False,
        ),
    ] = None,
    rerun: Annotated[
        str | None,
        typer.Option(
            metavar="FILE.rrd|spawn",
            help="Where to: a file, or a viewer that is started.",
            show_default="spawn, or NAME.rrd where there is no display",
        ),
    ] = None,
    diffusion: DiffusionOption = None,
    picture: PictureOption = None,
) -> None:
    """Show a result, or the frames of a source, in the Rerun viewer (extra viz) or as pictures.

    Frames of a source are segmented with --masks, --segmenter or the masks that the source names itself, or taken from
    --results; without any of these they are shown as they are, with their truth. A frame that fails is passed over; the
    exit status is then 2.
    With --picture, pictures are written, of a source with the name of each frame after that of FILE, and nothing is
    recorded unless --rerun says so.

    Examples:
    ldls view results/000571.npz --image image_2/000571.png

    ldls view results/000571.npz --image image_2/000571.png --picture 000571.png

    ldls view kitti/training --masks kitti/training/masks --frames 0:20 --rerun kitti.rrd

    ldls view DRIVE --results labels/tracks --picture pictures/drive.png
    """
    from ldls.io.results import FORMATS
    from ldls.viewing.files import check_picture

    name = path.resolve().stem
    target = rerun if picture is not None else rerun or default_target(name)
    check_recording(target, diffusion)
    check_picture(picture)
    failures: list[str] = []
    if path.is_file() and any(path.name.lower().endswith(each.ending) for each in FORMATS.values()):
        of_sources = {"dataset": dataset, "option": option, "frames": frames, "masks": masks, "results": results}
        of_masks = {"segmenter": segmenter, "min-score": min_score, "categories": categories}
        refuse({**of_sources, **of_masks}, f"{path} is a result, which has its masks and labels")
        message = view_result(path, image or [], target, name=name, diffusion=diffusion, picture=picture)
    else:
        source, indices = chosen_frames(path, dataset, option or [], frames)
        refuse({"image": image}, f"{path} is a source, which has its images")
        label = labelled(
            source,
            indices,
            masks=masks,
            segmenter=segmenter,
            min_score=min_score,
            categories=categories,
            results=results,
        )
        failures = show_frames(
            source, indices, label=label, picture=picture, target=target, name=name, diffusion=diffusion
        )
        for failure in failures:
            typer.secho(failure, err=True, fg="red")
        message = f"{len(indices) - len(failures):,} of {len(source):,} frames"
        if picture is not None:
            message += f"; wrote {picture.stem}-FRAME{picture.suffix} and others to {picture.parent}"
        if target is not None:
            message += f"; {where_recorded(target)}"
    console().print(message, soft_wrap=True)
    if failures:
        raise typer.Exit(FRAMES_FAILED)


def view_result(
    path: Path, images: Sequence[str], target: str | None, *, name: str, diffusion: int | None, picture: Path | None
) -> str:
    """Show a stored result; the message for the user."""
    from ldls.io import read_image, read_result
    from ldls.io.files import check_outputs
    from ldls.view import camera_names
    from ldls.viewing.files import picture_files

    result = read_result(path)
    files = image_files(images, camera_names(result.views))
    outputs = {"--picture": picture_files(picture), "--rerun": recording_files(target)}
    check_outputs(outputs, files.values())
    pictures = {camera: read_image(file) for camera, file in files.items()}
    messages = []
    if picture is not None:
        from ldls.viewing import save_pictures

        each = [pictures.get(camera) for camera in camera_names(result.views)]
        messages.append("wrote " + " ".join(map(str, save_pictures(picture, result, each))))
    if target is not None:
        messages.append(record(result, target, name=name, images=pictures, diffusion=diffusion))
    return "\n".join(messages)


def image_files(texts: Sequence[str], cameras: Sequence[str]) -> dict[str, str]:
    """Files of images by camera: CAMERA=FILE for one by name, FILE for all others in their order.

    Raises:
        InputError: There are more images than cameras, one camera has two or is not there, or an image without a name
            may be of any of several cameras.
    """
    paths: dict[str, str] = {}
    unnamed = []
    for text in texts:
        camera, equals, file = text.partition("=")
        if not equals or (camera not in cameras and Path(text).exists()):
            unnamed.append(text)
        elif camera not in cameras:
            raise InputError(f"--image: no camera {camera}, expected one of {', '.join(cameras) or 'none'}")
        elif camera in paths:
            raise InputError(f"--image: camera {camera} has {paths[camera]} and {file}; give one")
        else:
            paths[camera] = file
    others = [camera for camera in cameras if camera not in paths]
    if len(unnamed) > len(others):
        raise InputError(f"--image: got {len(texts)} images, the result has cameras {', '.join(cameras) or 'none'}")
    if 0 < len(unnamed) < len(others):
        raise InputError(
            f"--image: {unnamed[0]} is of which camera? Expected CAMERA=FILE with one of {', '.join(others)}"
        )
    paths |= zip(others, unnamed, strict=False)
    return paths

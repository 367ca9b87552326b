"""The frames of a source, one after the other, as pictures and in a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ldls.cli.mask_options import chosen_categories, say_own_masks
from ldls.cli.messages import in_options
from ldls.cli.options import refuse
from ldls.cli.progress import progress
from ldls.cli.recording_options import every_of, recording_files
from ldls.cli.source_options import parse_options
from ldls.errors import InputError, LdlsError

if TYPE_CHECKING:
    from ldls.batch.frame_work import FrameWork
    from ldls.datasets import Frame, Source
    from ldls.segmentation import Segmentation

MOST_FRAMES = 100
"""Frames that are shown where none are chosen."""
Labelled = Callable[[int], "tuple[Frame, Segmentation | None]"]
"""The frame of a number in its source, and its labels if it has any."""


def chosen_frames(
    path: Path, dataset: str | None, options: Sequence[str], frames: str | None
) -> tuple[Source, list[int]]:
    """The source at a path, and the numbers of the frames to show.

    Raises:
        LdlsError: It is no source.
        ParameterError: It has no such frames.
    """
    from ldls.batch.plan import chosen_of, parse_frames
    from ldls.datasets import open_source

    source = open_source(path, kind=dataset, **parse_options(options))
    chosen = slice(MOST_FRAMES) if frames is None else parse_frames(frames)
    return source, [index for index, _ in chosen_of(source, chosen)]


def labelled(
    source: Source,
    indices: Sequence[int],
    *,
    masks: str | None,
    segmenter: str | None,
    min_score: float | None,
    categories: str | None,
    results: Path | None,
) -> Labelled:
    """Frames of a source, segmented by given masks or its own, or with stored results, or without labels.

    `indices` are those that will be asked for.

    Raises:
        ParameterError: Labels would come from two places, masks of one image are given for several, or options choose
            among masks and there are none.
        InputError: There are no stored results.
    """
    own = results is None and say_own_masks(source, masks, segmenter)
    if masks is None and segmenter is None and not own:
        refuse({"min-score": min_score, "categories": categories}, "they choose among --masks or --segmenter's masks")
        if results is None:
            return lambda index: (source[index], None)
        if not any(results.glob("*.npz")):
            raise InputError(f"--results: {results} has no .npz; give `ldls run` --formats npz to have them written")
        return partial(_stored, source, results)
    refuse({"results": results}, "labels come from --masks, --segmenter or --results, one of them")
    from ldls.batch import RunSettings
    from ldls.batch.frame_work import FrameWork

    chosen = chosen_categories(categories)
    settings = RunSettings(masks=masks, segmenter=segmenter, min_score=min_score, categories=chosen)
    settings.check_images(len(indices), len(source.camera_names))
    # nothing is written, so there is no folder to write to
    return partial(_segmented, source, FrameWork(source, settings, Path()))


def show_frames(
    source: Source,
    indices: Sequence[int],
    *,
    label: Labelled,
    picture: Path | None,
    target: str | None,
    name: str,
    diffusion: int | None,
) -> list[str]:
    """Draw and record frames of a source, labelled by `label`; a line for each that cannot be.

    Args:
        source: The source.
        indices: Numbers of the frames.
        label: Gives each its labels.
        picture: Where pictures go, each with the name of its frame; None for no pictures.
        target: Where the recording goes; None for none.
        name: Name of the recording.
        diffusion: See `every_of`.

    Raises:
        LdlsError: None can be; the error is that of the first.
    """
    from ldls.io.files import check_outputs
    from ldls.view import camera_names
    from ldls.viewing import save_pictures
    from ldls.viewing.files import picture_files
    from ldls.viewing.recording import open_recording

    alone = len(indices) == 1
    places = {} if picture is None else {index: _named(picture, source.names[index]) for index in indices}
    pictures = [file for place in places.values() for file in picture_files(place)]
    outputs = {"--picture": pictures, "--rerun": recording_files(target)}
    check_outputs(outputs, (file for index in indices for file in source.files(index)))
    failures: list[tuple[str, Exception]] = []
    with nullcontext() if target is None else open_recording(target, name=name) as recording:
        for index in progress(indices, len(indices), "drawing" if recording is None else "recording"):
            try:
                frame, result = label(index)
                if result is None:
                    if recording is None or picture is not None:
                        raise InputError("--picture: no labels to draw; give --masks, --segmenter or --results")
                    recording.add_frame(frame)
                    continue
                images = {image.name: image.read() for image in frame.images}
                if picture is not None:
                    save_pictures(places[index], result, [images.get(camera) for camera in camera_names(result.views)])
                if recording is not None:
                    recording.add(
                        result,
                        images=images,
                        truth=frame.truth,
                        name=frame.name,
                        stamp=frame.stamp,
                        diffusion=every_of(diffusion, result, alone=alone),
                        alone=alone,
                    )
            except (LdlsError, OSError) as error:
                failures.append((source.names[index], error))
        if len(failures) == len(indices):
            raise failures[0][1]
    return [f"{frame} failed: {in_options(str(error))}" for frame, error in failures]


def _named(picture: Path, frame: str) -> Path:
    """Where the picture of a frame goes."""
    return picture.with_name(f"{picture.stem}-{frame}{picture.suffix}")


def _segmented(source: Source, work: FrameWork, index: int) -> tuple[Frame, Segmentation]:
    from ldls.batch.window import Window

    window = Window.of(((index, source.names[index]),))
    (item,) = window.works
    work.read(window)
    frame = item.frame
    work.segment(window)
    if item.error is not None:
        raise item.error.error from None
    assert frame is not None and item.result is not None
    return frame, item.result


def _stored(source: Source, results: Path, index: int) -> tuple[Frame, Segmentation]:
    """A frame and its stored result.

    Raises:
        InputError: There is no result of this frame, or it is of another cloud.
    """
    from ldls.io import read_result
    from ldls.viewing.formats import file_name

    path = results / file_name(source.names[index], "npz")
    if not path.exists():
        raise InputError(
            f"--results: {results} has no {path.name}; `ldls run` has not done this frame; run it, or choose others by "
            "--frames"
        )
    frame, result = source[index], read_result(path)
    if len(result.labels) != len(frame.points):
        raise InputError(
            f"--results: {path}: expected {len(frame.points):,} points, those of frame {frame.name} of {source.path}, "
            f"got {len(result.labels):,}; give the results of this source"
        )
    return frame, result

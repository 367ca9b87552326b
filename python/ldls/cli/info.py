"""`ldls info`: what a source of frames holds, and whether it looks sound."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from ldls.cli.messages import console, in_options, speaks_plainly
from ldls.cli.options import refuse
from ldls.cli.progress import progress
from ldls.cli.source_options import DatasetOption, SourceArgument, SourceOption, parse_options
from ldls.errors import ParameterError

if TYPE_CHECKING:
    from ldls.datasets import Frame, Source
    from ldls.datasets.inspection import Finding, FrameFacts

LOOKED_AT = 8
"""Frames that are read without --all."""
NO_IMAGES = (
    "no images, so that `ldls run` has no camera to label the points by; record a topic of images and its camera_info "
    "beside the clouds, or give masks and a camera of your own: ldls.segment(frame.points, masks, camera)"
)
SHOWN = 30
"""Findings that are listed."""


@speaks_plainly
def info(
    source: SourceArgument,
    dataset: DatasetOption = None,
    option: SourceOption = None,
    every: Annotated[bool, typer.Option("--all", help="Look at every frame, not only at some.")] = False,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png",
            help="Write a picture: one frame's points, coloured by depth, over its images.",
            dir_okay=False,
        ),
    ] = None,
    frame: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which frame to draw.", show_default="the first")
    ] = None,
) -> None:
    """Say what a source of frames holds and check some of its frames, or all.

    Prints kind, time, cameras, points and truth, then whatever is not as it should be: files that cannot be read,
    clouds without points, cameras that see none, images of another size than their calibration, gaps and steps back in
    time. Exit status 1 if something is broken. Of a bag all topics are listed, and one without images is looked at too.

    Example: ldls info 2011_09_26/2011_09_26_drive_0001_sync --picture check.png
    """
    from ldls.datasets.inspection import check_stamps, inspect, sample
    from ldls.io.files import check_outputs
    from ldls.viewing.files import check_picture

    if picture is None:
        refuse({"frame": frame}, "the frame to draw, and there is no --picture")
    frames = opened(source, dataset, parse_options(option or []))
    drawn = chosen_frame(frames, frame)
    check_picture(picture)
    check_outputs({"--picture": [picture]}, (file for at in range(len(frames)) for file in frames.files(at)))
    indices = list(range(len(frames))) if every else sample(len(frames), LOOKED_AT)
    facts = [inspect(frames, at) for at in progress(indices, len(indices), "looking at frames")]
    findings = [finding for each in facts for finding in each.findings] + check_stamps(frames.names, frames.stamps)
    screen = console()
    screen.print(summary_table(frames, facts))
    for table in (topic_table(frames), camera_table(frames, facts)):
        if table is not None:
            screen.print(table)
    if not frames.camera_names:
        screen.print(NO_IMAGES, soft_wrap=True)
    screen.print(
        finding_table(findings) if findings else f"looked at {len(facts)} of {len(frames)} frames, found nothing wrong"
    )
    if picture is not None:
        write_picture(frames[drawn], picture)
        screen.print(f"wrote {picture}", soft_wrap=True)
    if any(finding.broken for finding in findings):
        raise typer.Exit(1)


def opened(path: Path, dataset: str | None, options: dict[str, Any]) -> Source:
    """The source at a path; of a bag without a topic of images the clouds alone.

    Raises:
        LdlsError: It is no source.
    """
    from ldls.datasets import open_source
    from ldls.datasets.registry import guess_kind
    from ldls.datasets.rosbag import RosBag, has_images

    is_bag = path.exists() and (guess_kind(path) if dataset is None else dataset) == RosBag.kind
    if is_bag and "image_topics" not in options and not has_images(path, recover=bool(options.get("recover"))):
        options = {**options, "image_topics": ()}
    return open_source(path, kind=dataset, **options)


def topic_table(source: Source) -> Table | None:
    """Name, type and number of messages of each topic of a bag; None of other sources."""
    from ldls.datasets.rosbag import RosBag

    if not isinstance(source, RosBag):
        return None
    table = Table(title="topics")
    for heading in ("topic", "type", "messages"):
        table.add_column(heading, justify="right" if heading == "messages" else "left")
    for topic in source.all_topics:
        table.add_row(topic.name, topic.type, f"{topic.count:,}")
    return table


def summary_table(source: Source, facts: Sequence[FrameFacts]) -> Table:
    """Kind, frames, time, poses, masks, points and truth."""
    from ldls.datasets.file_source import counts_of
    from ldls.datasets.inspection import classes_of
    from ldls.datasets.stored_masks import own_masks

    table = Table(title=str(source.path), show_header=False)
    table.add_row("kind", source.kind)
    table.add_row("frames", f"{len(source):,} ({_range(source.names[0], source.names[-1])})")
    left_out = getattr(source, "left_out", {}).values()
    if left_out:
        table.add_row("left out", f"{len(left_out):,} ({counts_of(left_out)})")
    table.add_row("time", _time(source.stamps))
    table.add_row("poses", _poses(source, facts))
    counts = [each.n_points for each in facts if each.n_points] or [0]
    masks = ", ".join(f"{camera}: {place}" for camera, place in own_masks(source).items())
    table.add_row("masks", masks or "none of its own")
    table.add_row("points a frame", _range(f"{min(counts):,}", f"{max(counts):,}"))
    classes = classes_of(facts)
    labelled = sum(each.truth is not None for each in facts)
    named = ", ".join(f"{name} {count:,}" for name, count in classes.items())
    table.add_row("truth", f"points in {labelled} of {len(facts)} frames: {named}" if labelled else "none")
    return table


def camera_table(source: Source, facts: Sequence[FrameFacts]) -> Table | None:
    """A row for each camera of the first frame that was read; None where none was."""
    from ldls.datasets.inspection import field_of_view_deg

    whole = next((each for each in facts if each.in_view), None)
    if whole is None:
        return None
    table = Table(title="cameras")
    headings = ("camera", "height x width", "distortion", "view in degrees", "points in view", "s from sweep")
    for heading in headings:
        table.add_column(heading)
    for image in source[source.names.index(whole.name)].images:
        across, down = field_of_view_deg(image.camera)
        sizes = [each.image_sizes[image.name] for each in facts if image.name in each.image_sizes]
        shares = [each.in_view[image.name] for each in facts if image.name in each.in_view]
        offsets = [each.offsets_s[image.name] for each in facts if image.name in each.offsets_s]
        table.add_row(
            image.name,
            " x ".join(_range(str(min(side)), str(max(side))) for side in zip(*sizes, strict=True)) or "-",
            image.camera.distortion.model,
            f"{across:.0f} x {down:.0f}",
            _range(f"{min(shares):.1%}", f"{max(shares):.1%}"),
            _range(f"{min(offsets):+.3f}", f"{max(offsets):+.3f}") if offsets else "-",
        )
    return table


def finding_table(findings: Sequence[Finding]) -> Table:
    """The findings, the broken first."""
    broken = sum(finding.broken for finding in findings)
    table = Table(title=f"{broken:,} broken, {len(findings) - broken:,} worth a look")
    for heading in ("", "frame", "what"):
        table.add_column(heading)
    in_order = sorted(findings, key=lambda finding: not finding.broken)
    for finding in in_order[:SHOWN]:
        table.add_row("broken" if finding.broken else "look", finding.frame, in_options(finding.what))
    if len(findings) > SHOWN:
        table.add_row("", "", f"and {len(findings) - SHOWN:,} more")
    return table


def chosen_frame(source: Source, name: str | None) -> int:
    """The number of the frame of a name, or of the first.

    Raises:
        ParameterError: There is no such frame.
    """
    if name is not None and name not in source.names:
        raise ParameterError(f"--frame: got {name!r}, expected a name from {source.names[0]} to {source.names[-1]}")
    return 0 if name is None else source.names.index(name)


def write_picture(frame: Frame, path: Path) -> None:
    """Write the picture of a frame's points over its images.

    Raises:
        ParameterError: The frame has no image.
    """
    from ldls.viewing import save_picture
    from ldls.viewing.depth import depth_picture

    if not frame.images:
        raise ParameterError(f"--picture: frame {frame.name} has no image")
    save_picture(path, depth_picture(frame))


def _poses(source: Source, facts: Sequence[FrameFacts]) -> str:
    posed = sum(each.has_pose for each in facts)
    if posed:
        return f"in {posed} of {len(facts)} frames"
    # only sources whose frames may have poses say why there are none
    why = getattr(source, "why_no_poses", "")
    return f"none; {why}" if why else "none of its own"


def _range(low: str, high: str) -> str:
    return low if low == high else f"{low} to {high}"


def _time(stamps: Sequence[float | None]) -> str:
    import numpy as np

    known = [stamp for stamp in stamps if stamp is not None]
    if not known:
        return "not known"
    if len(known) == 1:
        return f"one moment, {known[0]:.3f} s"
    usual = float(np.median(np.diff(known)))
    rate = f", {1 / usual:.1f} frames a second" if usual > 0 else ""
    return f"{known[-1] - known[0]:.1f} s{rate}"

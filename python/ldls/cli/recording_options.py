"""Recordings for the Rerun viewer that commands make."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from ldls.cli.messages import console
from ldls.cli.options import refuse
from ldls.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ldls.segmentation import Segmentation

RerunOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE.rrd|spawn",
        help="Also record what was done for the Rerun viewer: in a file, or in a viewer that is started. Extra viz.",
        show_default=False,
    ),
]
DiffusionOption = Annotated[
    int | None,
    typer.Option(
        min=0,
        metavar="K",
        help="Record how labels spread, a picture every K products; 0 for none.",
        show_default="1 of one frame, none of several or of a run with --sweeps",
    ),
]


def every_of(diffusion: int | None, result: Segmentation, *, alone: bool) -> int | None:
    """Products from one picture of a result's diffusion to the next, None for no pictures.

    Raises:
        InputError: Pictures are asked for, and the result was labelled together with other sweeps.
    """
    from ldls.viewing.recording.diffusion import EVERY

    if diffusion == 0 or (diffusion is None and not alone):
        return None
    if result.report.n_sweeps == 1:
        return diffusion or EVERY
    why = f"its graph has {result.report.n_sweeps} sweeps, of which the result holds one"
    if diffusion is not None:
        raise InputError(f"--diffusion: cannot be shown, {why}; leave it out, or label the sweep without --sweeps")
    console().print(f"recorded without its diffusion: {why}", soft_wrap=True)
    return None


def check_recording(target: str | None, diffusion: int | None = None) -> None:
    """Refuse a target that cannot be recorded to, before any work is done.

    Raises:
        ParameterError: It is neither a file that ends in .rrd nor "spawn", or there is none and the diffusion is to be
            recorded.
        ImportError: The extra `viz` is not installed.
    """
    if target is None:
        refuse({"diffusion": diffusion}, "a recording shows it, and there is no --rerun")
        return
    from ldls.viewing.recording.session import check_target

    check_target(target)


def recording_files(target: str | None) -> list[Path]:
    """The file that is recorded to, if it is one."""
    if target is None:
        return []
    from ldls.viewing.recording.session import VIEWER

    return [] if target == VIEWER else [Path(target)]


def record(
    result: Segmentation,
    target: str,
    *,
    name: str,
    images: Mapping[str, NDArray[np.uint8]] | None = None,
    diffusion: int | None = None,
) -> str:
    """Record one segmentation; the message for the user."""
    from ldls.viewing.recording import open_recording

    with open_recording(target, name=name) as recording:
        recording.add(result, images=images, name=name, diffusion=every_of(diffusion, result, alone=True), alone=True)
    return where_recorded(target)


def where_recorded(target: str) -> str:
    """The place of a recording, and the command that opens it."""
    from ldls.viewing.recording.session import VIEWER

    if target == VIEWER:
        return "shown in the Rerun viewer"
    return f"wrote {target} ({Path(target).stat().st_size / 1e6:.1f} MB); open it with: rerun {quote(target)}"


def default_target(name: str) -> str:
    """A viewer where there is a display, else NAME.rrd in the working folder."""
    from ldls.viewing.recording.session import SUFFIX, VIEWER
    from ldls.viewing.recording.viewer import has_display

    return VIEWER if has_display() else f"{name}{SUFFIX}"

"""`ldls demo`: the method on a simulated street, without any data."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from ldls.cli.messages import console, object_table, speaks_plainly, timing_table
from ldls.cli.options import OutOption
from ldls.cli.recording_options import RerunOption, check_recording, record

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ldls.datasets import Frame
    from ldls.segmentation import Segmentation


@speaks_plainly
def demo(
    out: OutOption = Path("ldls-demo"),
    seed: Annotated[
        int | None,
        typer.Option(metavar="N", help="Simulate another street, that of this number; needs the extra `sim`.", min=0),
    ] = None,
    rerun: RerunOption = None,
) -> None:
    """Run the method on a simulated street: no data needed.

    Takes the frame that comes with ldls, a lidar sweep of a street with cars, people and more and the masks that a
    network would find in its image, segments the sweep, and holds direct projection and the method against the true
    labels. Writes the results as `ldls segment` does, pictures (the image, the bird's-eye view, and the comparison
    with direct projection), and the frame itself so that you can run that command on it.

    Example: ldls demo --out demo
    """
    import ldls
    from ldls.simulation import sample_frame, scene_frame
    from ldls.viewing import save_pictures
    from ldls.viewing.formats import write_formats

    check_recording(rerun)
    frame = sample_frame() if seed is None else scene_frame(seed)
    (image,) = frame.images
    assert image.masks is not None and frame.truth is not None
    rgb = image.read()
    result = ldls.segment(frame.points, [ldls.View(image.masks, image.camera, image.name)])
    out.mkdir(parents=True, exist_ok=True)
    written = write_formats(result, out, "demo", ("npz", "label", "ply"), [rgb])
    written += save_pictures(out / "demo.png", result, rgb)
    command = write_inputs(out, frame, rgb)

    screen = console()
    screen.print(object_table(result.objects))
    screen.print(timing_table(result.timings))
    screen.print(accuracy_table(result, frame.truth.instances))
    screen.print("wrote " + " ".join(map(str, written)), soft_wrap=True)
    screen.print(f"the same from files: {command}", soft_wrap=True)
    if rerun is not None:
        screen.print(record(result, rerun, name="demo", images={image.name: rgb}), soft_wrap=True)


def accuracy_table(result: Segmentation, truth: NDArray[np.int32]) -> Table:
    """Intersection over union with the truth, (N,) instances, of each mask's object, by direct projection and by ldls.

    A mask is of the object that most of its points in direct projection belong to.
    """
    import numpy as np

    seen = result.in_view
    truth, direct, labels = truth[seen], result.direct_labels[seen], result.labels[seen]
    rows, ious = [], []
    for instance in result.instances:
        points = np.bincount(truth[direct == instance.label], minlength=2)[1:]
        if points.any():  # else it is a mask of nothing
            mine = truth == points.argmax() + 1
            rows.append((instance, int(mine.sum())))
            ious.append([_iou(one == instance.label, mine) for one in (direct, labels)])
    of_direct, of_method = np.mean(ious, axis=0) if ious else (np.nan, np.nan)
    table = Table(title="accuracy against the true labels (IoU of points, %)", show_footer=True)
    table.add_column("number", justify="right")
    table.add_column("object", footer="mean")
    table.add_column("true points", justify="right")
    table.add_column("direct projection", justify="right", footer=f"{of_direct:.1f}")
    table.add_column("ldls", justify="right", footer=f"{of_method:.1f}")
    for (instance, count), (before, after) in zip(rows, ious, strict=True):
        table.add_row(str(instance.label), instance.name, f"{count:,}", f"{before:.1f}", f"{after:.1f}")
    return table


def write_inputs(out: Path, frame: Frame, rgb: NDArray[np.uint8]) -> str:
    """Write the frame with the pixels of its image as files that `ldls segment` reads; the command that does so."""
    from ldls.io import save
    from ldls.simulation.kitti_layout import calibration_lines, write_lines, write_picture, write_points

    folder, (image,) = out / "input", frame.images
    assert image.masks is not None
    write_points(folder / "points.bin", frame)
    save(image.masks, folder / "masks.npz")
    write_picture(folder / "image.png", rgb)
    write_lines(folder / "calib.txt", calibration_lines(image.camera))
    files = {
        "points": folder / "points.bin",
        "calib": folder / "calib.txt",
        "masks": folder / "masks.npz",
        "image": folder / "image.png",
        "out": out / "from-files",
    }
    return "ldls segment " + " ".join(f"--{option} {quote(str(path))}" for option, path in files.items())


def _iou(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    """Intersection over union, in percent."""
    return float(100 * (one & other).sum() / (one | other).sum())

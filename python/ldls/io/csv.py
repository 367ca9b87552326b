"""CSV: one line a point."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING

from ldls.io.labeled_points import instances, names, positions
from ldls.io.whole_file import whole_file

if TYPE_CHECKING:
    from ldls.segmentation import Segmentation


def write(path: Path, result: Segmentation) -> None:
    """Write names, then x y z (and intensity), `label`, `instance`, `category`, `name` and `confidence` of each point.

    `label` is -1 out of view, where `instance` is 0; `name` is empty for background and out of view. Numbers have as
    many digits as tell them apart in their precision.
    """
    columns = {name: column.astype(str).tolist() for name, column in positions(result).items()}
    by_label = names(result)
    columns |= {
        "label": result.labels.tolist(),
        "instance": instances(result).tolist(),
        "category": result.categories.tolist(),
        "name": [by_label[label] for label in result.labels],
        "confidence": result.confidence.astype(str).tolist(),
    }
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    with whole_file(path) as file:
        file.write(text.getvalue().encode())

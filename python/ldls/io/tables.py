"""Tables with a row a point: CSV and Parquet."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

import ldls._ldls as _ldls
from ldls._optional import require
from ldls.io.files import whole_file
from ldls.io.labelled_points import instances, names, positions
from ldls.segmentation import Segmentation


def write_csv(path: Path, result: Segmentation) -> None:
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


def write_parquet(path: Path, result: Segmentation) -> None:
    """Write x y z (and intensity), `label`, `instance`, `category`, `name` and `confidence` of each point.

    `label` is -1 out of view, where `instance` is 0; `name` is null for background and out of view. The metadata has
    version, parameters and report as JSON under the key `ldls`.

    Raises:
        ImportError: The extra `arrow` is not installed.
    """
    pyarrow = require("pyarrow", "arrow")
    parquet = require("pyarrow.parquet", "arrow")
    by_label = names(result)
    codes = result.labels % len(by_label)  # label -1, out of view, picks the last entry
    columns = {name: pyarrow.array(np.ascontiguousarray(column)) for name, column in positions(result).items()}
    columns |= {
        "label": pyarrow.array(result.labels),
        "instance": pyarrow.array(instances(result)),
        "category": pyarrow.array(result.categories),
        "name": pyarrow.array(by_label, pyarrow.string()).take(pyarrow.array(codes)).dictionary_encode(),
        "confidence": pyarrow.array(result.confidence),
    }
    about = {"version": _ldls.__version__, "params": asdict(result.params), "report": asdict(result.report)}
    table = pyarrow.table(columns, metadata={"ldls": json.dumps(about)})
    with whole_file(path) as file:
        parquet.write_table(table, file)

"""YAML files of calibrations, OpenCV's dialect among them, loaded without running anything."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

from ldls._optional import require
from ldls.camera.fields import Fields
from ldls.errors import CalibrationError, LimitError, UnsupportedFormatError
from ldls.io.files import regular_file

MAX_BYTES = 1 << 22
OPENCV_MATRIX = "tag:yaml.org,2002:opencv-matrix"
MAPPING = "tag:yaml.org,2002:map"


def read_yaml(path: str | PathLike[str]) -> Fields:
    """The entries of a YAML file.

    Raises:
        CalibrationError: It is not YAML with keys and values, or a key stands there twice; the message names the line.
        UnsupportedFormatError: It is XML.
        LimitError: It is larger than any calibration.
        FileFormatError: It is no regular file.
        FileNotFoundError: There is no such file.
        ImportError: The extra `yaml` is not installed.
    """
    yaml = require("yaml", "yaml")
    path = regular_file(path)
    if path.stat().st_size > MAX_BYTES:
        raise LimitError(f"{path}: {path.stat().st_size} bytes, expected a calibration of at most {MAX_BYTES}")
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: not a text file ({error.reason} at byte {error.start})") from None
    if text.lstrip().startswith("<"):
        raise UnsupportedFormatError(f"{path}: got XML, expected YAML; save the calibration as .yml or .yaml")
    try:
        entries = yaml.load(_without_opencv_directive(text), _loader(yaml))
    except yaml.YAMLError as error:
        raise CalibrationError(f"{path}{_line_of(error)}: not YAML ({getattr(error, 'problem', error)})") from None
    except (RecursionError, ValueError) as error:
        raise CalibrationError(f"{path}: not a calibration in YAML ({error})") from None
    if not isinstance(entries, Mapping):
        raise CalibrationError(f"{path}: expected keys with values, got {type(entries).__name__}")
    return Fields(str(path), entries)


def _without_opencv_directive(text: str) -> str:
    """`text` with OpenCV's `%YAML:1.0`, which is no directive of YAML, as a comment: lines keep their numbers."""
    return f"#{text}" if text.startswith("%YAML:") else text


def _loader(yaml: Any) -> Any:  # noqa: ANN401
    """The safe loader, which also knows OpenCV's matrices and refuses a key that stands there twice."""

    def mapping(loader: Any, node: Any) -> dict[object, object]:  # noqa: ANN401
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key.value, str):
                continue  # keys that are no words are for the safe loader to judge
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"key '{key.value}' stands there twice", key.start_mark
                )
            seen.add(key.value)
        entries: dict[object, object] = loader.construct_mapping(node, deep=True)
        return entries

    loader: Any = type("CalibrationLoader", (yaml.SafeLoader,), {})
    for tag in (MAPPING, OPENCV_MATRIX):
        loader.add_constructor(tag, mapping)
    return loader


def _line_of(error: Any) -> str:  # noqa: ANN401
    mark = getattr(error, "problem_mark", None)
    return "" if mark is None else f", line {mark.line + 1}"

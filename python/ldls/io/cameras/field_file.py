"""Calibration files of names and values: YAML, and OpenCV's XML."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike

from ldls.camera.fields import Fields
from ldls.errors import CalibrationError
from ldls.io.cameras import xml_file, yaml_file
from ldls.io.files import open_file

MAX_BYTES = 1 << 18


def read_fields(path: str | PathLike[str]) -> Fields:
    """The entries of a file.

    Raises:
        CalibrationError: It has no keys with values, or a key stands there twice; the message names the line.
        UnsupportedFormatError: It is XML of something else.
        LimitError: It is larger than any calibration.
        FileFormatError: It is no regular file.
        FileNotFoundError: There is no such file.
        ImportError: It is YAML, and the extra `yaml` is not installed.
    """
    with open_file(path, "calibration", limit=MAX_BYTES) as file:
        return fields_of(file.text(), str(path))


def fields_of(text: str, path: str) -> Fields:
    """The entries of the text of a file; errors as of `read_fields`, those of YAML with the file and line."""
    entries = xml_file.entries_of(text) if text.lstrip().startswith("<") else yaml_file.entries_of(text, path)
    if not isinstance(entries, Mapping):
        raise CalibrationError(f"expected keys with values, got {type(entries).__name__}")
    return Fields(path, entries)

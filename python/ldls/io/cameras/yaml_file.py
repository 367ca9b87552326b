"""YAML files of calibrations, OpenCV's dialect among them, loaded without running anything."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

from ldls._optional import require
from ldls.camera.fields import Fields
from ldls.errors import CalibrationError, UnsupportedFormatError
from ldls.io.files import open_file

MAX_BYTES = 1 << 18
MAX_DEPTH = 32
"""Levels of nesting: calibrations have six."""
OPENCV_MATRIX = "tag:yaml.org,2002:opencv-matrix"
NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
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
    with open_file(path, "calibration in YAML", limit=MAX_BYTES) as file:
        text = file.text()
        if text.lstrip().startswith("<"):
            raise UnsupportedFormatError("got XML, expected YAML; save the calibration as .yml or .yaml")
        try:
            text = _without_opencv_directive(text)
            _check_growth(yaml, text)
            entries = yaml.load(text, _loader(yaml))
        except yaml.YAMLError as error:
            raise CalibrationError(f"{path}{_line_of(error)}: not YAML ({getattr(error, 'problem', error)})") from None
        if not isinstance(entries, Mapping):
            raise CalibrationError(f"expected keys with values, got {type(entries).__name__}")
        return Fields(str(path), entries)


def _without_opencv_directive(text: str) -> str:
    """`text` with OpenCV's `%YAML:1.0`, which is no directive of YAML, as a comment: lines keep their numbers."""
    return f"#{text}" if text.startswith("%YAML:") else text


def _check_growth(yaml: Any, text: str) -> None:  # noqa: ANN401
    """Refuse what lets content grow beyond its text: aliases, and nesting without end."""
    depth = 0
    for event in yaml.parse(text, _safe_loader(yaml)):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if isinstance(event, yaml.AliasEvent):
            problem = "aliases are not read; write the value out"
        elif depth > MAX_DEPTH:
            problem = f"more than {MAX_DEPTH} levels of nesting"
        else:
            continue
        raise yaml.composer.ComposerError(None, None, problem, event.start_mark)


def _safe_loader(yaml: Any) -> Any:  # noqa: ANN401
    """The fast one, where the library was built with it."""
    return getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def _loader(yaml: Any) -> Any:  # noqa: ANN401
    """The safe loader, which also knows OpenCV's matrices and refuses a key that stands there twice.

    Digits with colons are text, as in YAML 1.2, not numbers to the base 60, which take long to reckon.
    """

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

    def number(loader: Any, node: Any) -> object:  # noqa: ANN401
        text = loader.construct_scalar(node)
        return text if ":" in text else yaml.SafeLoader.yaml_constructors[node.tag](loader, node)

    loader: Any = type("CalibrationLoader", (_safe_loader(yaml),), {})
    for tag in (MAPPING, OPENCV_MATRIX):
        loader.add_constructor(tag, mapping)
    for tag in NUMBERS:
        loader.add_constructor(tag, number)
    return loader


def _line_of(error: Any) -> str:  # noqa: ANN401
    mark = getattr(error, "problem_mark", None)
    return "" if mark is None else f", line {mark.line + 1}"

"""YAML files of calibrations, OpenCV's dialect among them, loaded without running anything."""

from __future__ import annotations

from typing import Any

from ldls._optional import require
from ldls.errors import CalibrationError

MAX_DEPTH = 32
"""Levels of nesting: calibrations have six."""
TOO_DEEP = f"more than {MAX_DEPTH} levels of nesting"
OPENCV_MATRICES = ("tag:yaml.org,2002:opencv-matrix", "tag:yaml.org,2002:opencv-nd-matrix")
NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
MAPPING = "tag:yaml.org,2002:map"


def entries_of(text: str, path: str) -> object:
    """The first document of a text; `ros2 topic echo` ends each with a line of dashes.

    Raises:
        CalibrationError: It is not YAML, or a key stands there twice; the message names the line.
        ImportError: The extra `yaml` is not installed.
    """
    yaml = require("yaml", "yaml")
    # OpenCV's %YAML:1.0 is no directive of YAML; as a comment it keeps the numbers of the lines
    text = f"#{text}" if text.startswith("%YAML:") else text
    try:
        _check_growth(yaml, text)
        return next(iter(yaml.load_all(text, _loader(yaml))), None)
    except yaml.YAMLError as error:
        problem = getattr(error, "problem", error)
        # newer versions of the library have a limit of their own, and read ahead up to it
        if "nesting" in str(problem):
            problem = TOO_DEEP
        raise CalibrationError(f"{path}{_line_of(error)}: not YAML ({problem})") from None


def _check_growth(yaml: Any, text: str) -> None:  # noqa: ANN401
    """Refuse what lets content grow beyond its text: aliases, and nesting without end."""
    depth = 0
    for event in yaml.parse(text, _safe_loader(yaml)):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if isinstance(event, yaml.AliasEvent):
            problem = "aliases are not read; write the value out"
        elif depth > MAX_DEPTH:
            problem = TOO_DEEP
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
    for tag in (MAPPING, *OPENCV_MATRICES):
        loader.add_constructor(tag, mapping)
    for tag in NUMBERS:
        loader.add_constructor(tag, number)
    return loader


def _line_of(error: Any) -> str:  # noqa: ANN401
    mark = getattr(error, "problem_mark", None)
    return "" if mark is None else f", line {mark.line + 1}"

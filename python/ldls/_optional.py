"""Libraries that the default installation does not bring."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def require(module: str, extra: str) -> Any:  # noqa: ANN401
    """The imported `module`.

    Raises:
        ImportError: It is not installed; the message names the extra that brings it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        message = f"{package} is needed here and not installed; run: pip install 'ldls[{extra}]'"
        raise ImportError(message, name=package) from error

"""The outcome of a frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Outcome:
    """A frame that is finished, well or not.

    Attributes:
        record: Its line of the journal: `frame`, and `files` with their sizes, `inputs` and `objects`, or `error`.
        seconds: Time that each stage took.
    """

    record: Mapping[str, Any]
    seconds: Mapping[str, float] = field(default_factory=dict)

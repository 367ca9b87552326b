"""Checks of what a network gave back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.errors import FileFormatError, MaskError

SCORE_SLACK = 1e-3
"""Distance from [0, 1] up to which a score counts as rounded."""


def check_scores(scores: NDArray[Any]) -> NDArray[np.float32]:
    """(N,) scores, clipped to [0, 1].

    Raises:
        MaskError: A score is NaN or further than `SCORE_SLACK` outside; the message names the instance.
    """
    wrong = np.flatnonzero(~((scores >= -SCORE_SLACK) & (scores <= 1 + SCORE_SLACK)))
    if wrong.size:
        raise MaskError(
            f"instance {wrong[0]}: score is {scores[wrong[0]]}, expected 0 to 1; "
            "the model may have lost precision when it was exported"
        )
    clipped: NDArray[np.float32] = np.clip(scores, 0, 1).astype(np.float32)
    return clipped


def check_finite(what: str, values: NDArray[Any], instances: NDArray[np.int64]) -> None:
    """Refuse `values`, a row for each of `instances`, that are not finite.

    Raises:
        MaskError: A row is not; the message names the instance and `what`.
    """
    wrong = np.flatnonzero(~np.isfinite(values).all(axis=tuple(range(1, values.ndim))))
    if wrong.size:
        raise MaskError(
            f"instance {instances[wrong[0]]}: {what} holds NaN or infinity; "
            "the model may have lost precision when it was exported"
        )


def expect_shape(name: str, values: NDArray[Any], shape: tuple[int | None, ...]) -> None:
    """Refuse an output of another shape than `shape`, where None stands for any length.

    Raises:
        FileFormatError: It has another.
    """
    fits = values.ndim == len(shape) and all(w in (None, got) for w, got in zip(shape, values.shape, strict=True))
    if not fits:
        expected = ", ".join("*" if w is None else str(w) for w in shape)
        raise FileFormatError(f"output {name}: expected shape ({expected}), got {values.shape} from the model")

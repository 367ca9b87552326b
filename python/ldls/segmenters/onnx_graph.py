"""Inputs and outputs of an ONNX model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ldls._optional import require
from ldls.errors import UnsupportedFormatError

Shape = tuple[int | str, ...]


@dataclass(frozen=True)
class Value:
    """An input or output.

    Attributes:
        name: Its name.
        dtype: NumPy's name of its type; "?" where it is no array of numbers.
        shape: Its sides: numbers, names of sides that vary, "?" for those without a name; None if even their
            number is unknown.
    """

    name: str
    dtype: str
    shape: Shape | None

    def __str__(self) -> str:
        sides = "?" if self.shape is None else ", ".join(str(side) for side in self.shape)
        return f"{self.name} {self.dtype} ({sides})"

    @property
    def is_float(self) -> bool:
        """True if it holds floating-point numbers."""
        return self.dtype.startswith("float")

    @property
    def rank(self) -> int:
        """Number of sides; -1 where it is unknown."""
        return -1 if self.shape is None else len(self.shape)

    def may_be(self, *sides: int | None) -> bool:
        """Return True if its shape is known and fits these sides, None being any."""
        return self.rank == len(sides) and all(
            want is None or isinstance(got, str) or got == want
            for got, want in zip(self.shape or (), sides, strict=True)
        )


@dataclass(frozen=True)
class Signature:
    """Inputs, outputs and notes of a model.

    Attributes:
        source: File that it was read from, for messages.
        inputs: What it takes; weights are left out.
        outputs: What it gives.
        notes: Its custom metadata.
    """

    source: str
    inputs: tuple[Value, ...]
    outputs: tuple[Value, ...]
    notes: dict[str, str]

    @classmethod
    def of(cls, source: str, model: Any) -> Signature:  # noqa: ANN401
        """The signature of an `onnx.ModelProto`."""
        weights = {tensor.name for tensor in model.graph.initializer}
        return cls(
            source=source,
            inputs=tuple(_value(v) for v in model.graph.input if v.name not in weights),
            outputs=tuple(_value(v) for v in model.graph.output),
            notes={entry.key: entry.value for entry in model.metadata_props},
        )

    def __str__(self) -> str:
        return f"inputs {_listed(self.inputs)}; outputs {_listed(self.outputs)}"

    @property
    def image(self) -> Value | None:
        """The one input, if it takes one RGB image: float, (3, H, W) or (1, 3, H, W), sides known or not."""
        if len(self.inputs) != 1 or not self.inputs[0].is_float:
            return None
        image = self.inputs[0]
        return image if image.may_be(3, None, None) or image.may_be(None, 3, None, None) else None


def image_input(signature: Signature) -> Value:
    """The input of a model that takes one image at a time.

    Raises:
        UnsupportedFormatError: It takes anything else, or several images.
    """
    image = signature.image
    if image is None:
        raise UnsupportedFormatError(
            f"{signature.source}: expected one input of floats, (3, H, W) or (1, 3, H, W), got {signature}"
        )
    if image.rank == 4 and not image.may_be(1, None, None, None):
        raise UnsupportedFormatError(f"{signature.source}: input {image} takes a batch; export it for a batch of 1")
    return image


def _value(info: Any) -> Value:  # noqa: ANN401
    tensor = info.type.tensor_type
    if not info.type.HasField("tensor_type"):
        return Value(info.name, "?", None)
    shape = tuple(_side(side) for side in tensor.shape.dim) if tensor.HasField("shape") else None
    return Value(info.name, _dtype(tensor.elem_type), shape)


def _dtype(element: int) -> str:
    helper = require("onnx.helper", "onnx")
    try:
        return str(np.dtype(helper.tensor_dtype_to_np_dtype(element)))
    except (KeyError, TypeError, ValueError):
        return "?"


def _side(side: Any) -> int | str:  # noqa: ANN401
    if side.HasField("dim_value"):
        return int(side.dim_value)
    return str(side.dim_param) or "?"


def _listed(values: Sequence[Value]) -> str:
    return ", ".join(str(value) for value in values) or "none"

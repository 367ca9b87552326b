"""ONNX files, looked through before anything runs them.

Weights of a model may lie in other files, which it names; its operators may come from libraries. Neither is followed
out of the model's folder or out of what onnxruntime brings along.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from ldls._optional import require
from ldls.errors import (
    CorruptFileError,
    LimitError,
    TruncatedFileError,
    UnsupportedFormatError,
)
from ldls.io.files import open_file, strictly_below

MAX_BYTES = 2 << 30
"""Largest model file; protobuf, of which ONNX is made, ends there. Larger weights lie in files of their own."""
DOMAINS = frozenset({"", "ai.onnx", "ai.onnx.ml", "com.microsoft"})
"""Domains whose operators onnxruntime has itself."""
OPERATORS_WITH_FILES = frozenset({("com.microsoft", "EPContext"), ("com.microsoft", "PythonOp")})
"""Operators of these domains that load a file or run Python."""
LFS_POINTER = b"version https://git-lfs"


@dataclass(frozen=True, eq=False)
class OnnxFile:
    """A model that was looked through.

    Attributes:
        path: Where it lies.
        model: `onnx.ModelProto`, without the weights in other files.
        content: Its bytes.
        has_external_data: True if weights lie in other files.
    """

    path: Path
    model: Any
    content: bytes
    has_external_data: bool


def read_onnx(path: str | PathLike[str]) -> OnnxFile:
    """The model at `path`, whose operators and files of weights can be trusted to be what they seem.

    Raises:
        TruncatedFileError: It, or a file of its weights, ends too early.
        CorruptFileError: It is not an ONNX model, or a file of its weights is missing.
        UnsupportedFormatError: It needs operators from a library.
        UnsafePathError: Its weights lie outside its folder.
        LimitError: It is larger than `MAX_BYTES`.
        FileNotFoundError: There is no such file.
        ImportError: `ldls[onnx]` is not installed.
    """
    path = Path(path)
    with open_file(path, "ONNX model", limit=sys.maxsize) as file:
        if file.size > MAX_BYTES:
            raise LimitError(f"{file.size} bytes, expected at most {MAX_BYTES}; save the weights as external data")
        content = file.read()
        model = _parse(content)
        _check_operators(model)
        external = [tensor for tensor in _tensors(model) if tensor.data_location == tensor.EXTERNAL]
        for tensor in external:
            _check_external(path, tensor)
        return OnnxFile(path, model, content, bool(external))


def _parse(content: bytes) -> Any:  # noqa: ANN401
    onnx = require("onnx", "onnx")
    message = require("google.protobuf.message", "onnx")
    if content.startswith(LFS_POINTER):
        raise CorruptFileError("a Git LFS pointer, not the model itself; run: git lfs pull")
    _check_fields(content)
    try:
        model = onnx.load_model_from_string(content)
    except (message.DecodeError, ValueError) as error:
        raise CorruptFileError(f"not an ONNX model ({error})") from None
    if not model.graph.node:
        raise CorruptFileError("not an ONNX model, or one without a graph")
    return model


def _check_fields(content: bytes) -> None:
    """Refuse what is cut off or no model, which the outermost fields alone tell apart."""
    at = 0
    try:
        while at < len(content):
            start = at
            tag, at = _varint(content, at)
            at = _field_end(content, at, tag & 7)
            if tag >> 3 == 0 or at < 0:
                raise CorruptFileError(f"not an ONNX model (byte {start} begins no protobuf field)")
    except IndexError:
        at = len(content) + 1
    if not content:
        raise TruncatedFileError("empty, expected an ONNX model; download it again")
    if at > len(content):
        raise TruncatedFileError(f"ends after {len(content)} bytes, expected at least {at}; download it again")


def _field_end(content: bytes, at: int, wire_type: int) -> int:
    """Return the end of a field whose content begins at `at`; -1 for an unknown type of field."""
    match wire_type:
        case 0:
            return _varint(content, at)[1]
        case 1:
            return at + 8
        case 2:
            length, at = _varint(content, at)
            return at + length
        case 5:
            return at + 4
    return -1


def _varint(content: bytes, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        byte = content[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            break
    return value, at


def _check_operators(model: Any) -> None:  # noqa: ANN401
    own = {(function.domain, function.name) for function in model.functions}
    for node in _nodes(model):
        operator = (node.domain, node.op_type)
        if operator not in own and (node.domain not in DOMAINS or operator in OPERATORS_WITH_FILES):
            raise UnsupportedFormatError(
                f"operator {node.domain}::{node.op_type} needs a library or file of its own, expected "
                "operators of ONNX and onnxruntime; export the model without it"
            )


def _nodes(model: Any) -> Iterator[Any]:  # noqa: ANN401
    """Every node, those of functions and of the graphs in attributes too."""
    yield from _with_subgraphs(model.graph.node)
    for function in model.functions:
        yield from _with_subgraphs(function.node)


def _with_subgraphs(nodes: Iterable[Any]) -> Iterator[Any]:
    for node in nodes:
        yield node
        for graph in _subgraphs(node):
            yield from _with_subgraphs(graph.node)


def _subgraphs(node: Any) -> Iterator[Any]:  # noqa: ANN401
    for attribute in node.attribute:
        if attribute.HasField("g"):
            yield attribute.g
        yield from attribute.graphs


def _tensors(model: Any) -> Iterator[Any]:  # noqa: ANN401
    """Every tensor of weights and constants, wherever it stands."""
    yield from _initializers(model.graph)
    for node in _nodes(model):
        for graph in _subgraphs(node):
            yield from _initializers(graph)
        for attribute in node.attribute:
            yield from _attribute_tensors(attribute)
    for function in model.functions:
        for attribute in function.attribute_proto:
            yield from _attribute_tensors(attribute)


def _initializers(graph: Any) -> Iterator[Any]:  # noqa: ANN401
    yield from graph.initializer
    yield from _dense(graph.sparse_initializer)


def _attribute_tensors(attribute: Any) -> Iterator[Any]:  # noqa: ANN401
    if attribute.HasField("t"):
        yield attribute.t
    yield from attribute.tensors
    if attribute.HasField("sparse_tensor"):
        yield from _dense([attribute.sparse_tensor])
    yield from _dense(attribute.sparse_tensors)


def _dense(sparse_tensors: Iterable[Any]) -> Iterator[Any]:
    for sparse in sparse_tensors:
        yield sparse.values
        yield sparse.indices


def _check_external(path: Path, tensor: Any) -> None:  # noqa: ANN401
    entries = {entry.key: entry.value for entry in tensor.external_data}
    folder = path.resolve().parent
    weights = strictly_below(folder, entries.get("location", ""), place=f"tensor {tensor.name!r}")
    offset = _whole_number(tensor.name, entries.get("offset", "0"))
    length = _whole_number(tensor.name, entries.get("length", str(_bytes_needed(tensor))))
    if not os.path.isfile(weights):  # noqa: PTH113 - unlike Path.is_file, it takes any name
        raise CorruptFileError(
            f"tensor {tensor.name!r} lies in {weights.name!r}, which is not there; keep the files of a model together"
        )
    size = weights.stat().st_size
    if offset + length > size:
        raise TruncatedFileError(
            f"{weights}: tensor {tensor.name!r} ends at byte {offset + length}, the file after {size}; "
            "download it again"
        )


def _whole_number(name: str, text: str) -> int:
    if not (text.isascii() and text.isdigit()):
        raise CorruptFileError(f"tensor {name!r} has offset or length {text!r}, expected a whole number")
    return int(text)


def _bytes_needed(tensor: Any) -> int:  # noqa: ANN401
    helper = require("onnx.helper", "onnx")
    try:
        item = helper.tensor_dtype_to_np_dtype(tensor.data_type).itemsize
    except (KeyError, ValueError):  # onnxruntime refuses a type that ONNX does not have
        return 0
    return int(math.prod(tensor.dims) * item)

"""Every ONNX file that must not reach onnxruntime."""

import numpy as np
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from ldls.errors import (
    CorruptFileError,
    LdlsError,
    LimitError,
    TruncatedFileError,
    UnsafePathError,
    UnsupportedFormatError,
)
from ldls.segmenters import OnnxSegmenter, onnx_file

onnx = pytest.importorskip("onnx")
runtime = pytest.importorskip("onnxruntime")


from segmenters import graphs  # noqa: E402

BOX = np.array([[2, 3, 12, 13]], np.float32)


def sound_model():
    return graphs.constant_detections(
        BOX, np.array([3]), np.array([0.9], np.float32), np.ones((1, 1, 20, 30), np.float32)
    )


def external(location, **entries):
    """A model whose boxes lie at `location`."""
    model = sound_model()
    tensor = model.graph.initializer[0]
    tensor.ClearField("raw_data")
    tensor.data_location = TensorProto.EXTERNAL
    for key, value in {"location": location, "offset": "0", "length": "16", **entries}.items():
        tensor.external_data.add(key=key, value=value)
    return model


def external_in(place):
    """A model with a tensor outside its folder, at a place where one may hide."""
    model = sound_model()
    tensor = TensorProto(name="hidden", data_type=TensorProto.FLOAT, dims=[4], data_location=TensorProto.EXTERNAL)
    tensor.external_data.add(key="location", value="../weights.bin")
    place(model, tensor)
    return model


def in_attribute(model, tensor):
    model.graph.node.append(helper.make_node("Constant", [], ["c"], value=tensor))


def in_subgraph(model, tensor):
    branch = helper.make_graph([helper.make_node("Identity", ["hidden"], ["r"])], "branch", [], [], [tensor])
    model.graph.node.append(helper.make_node("If", ["condition"], ["r"], then_branch=branch, else_branch=branch))


def in_function(model, tensor):
    node = helper.make_node("Constant", [], ["c"], value=tensor)
    model.functions.append(helper.make_function("own", "F", [], ["c"], [node], [helper.make_opsetid("", 17)]))


def in_sparse_initializer(model, tensor):
    sparse = helper.make_sparse_tensor(tensor, numpy_helper.from_array(np.arange(4), "i"), [9])
    model.graph.sparse_initializer.append(sparse)


def with_operator(domain, operator):
    def build():
        model = sound_model()
        model.graph.node.append(helper.make_node(operator, ["image"], ["x"], domain=domain))
        return model

    return build


def with_operator_in_subgraph():
    model = sound_model()
    node = helper.make_node("Evil", ["image"], ["r"], domain="library")
    branch = helper.make_graph([node], "branch", [], [])
    model.graph.node.append(helper.make_node("If", ["condition"], ["r"], then_branch=branch, else_branch=branch))
    return model


def with_operator_in_function():
    model = sound_model()
    node = helper.make_node("Evil", ["a"], ["b"], domain="library")
    model.functions.append(helper.make_function("own", "F", ["a"], ["b"], [node], [helper.make_opsetid("library", 1)]))
    return model


MODELS = [
    pytest.param(lambda: external("/etc/hostname"), UnsafePathError, "/etc/hostname", id="absolute path"),
    pytest.param(lambda: external("../weights.bin"), UnsafePathError, "leads out of", id="path with .."),
    pytest.param(lambda: external("a/../weights.bin"), UnsafePathError, "leads out of", id="path with .. inside"),
    pytest.param(lambda: external("C:\\weights.bin"), UnsafePathError, "leads out of", id="drive of Windows"),
    pytest.param(lambda: external("..\\weights.bin"), UnsafePathError, "leads out of", id="path of Windows with .."),
    pytest.param(lambda: external("\\\\host\\share"), UnsafePathError, "leads out of", id="share of Windows"),
    pytest.param(lambda: external("weights\0.bin"), UnsafePathError, "names no file", id="NUL"),
    pytest.param(lambda: external(""), UnsafePathError, "names no file", id="no path"),
    pytest.param(lambda: external("link.bin"), UnsafePathError, "leads by a link", id="link out of the folder"),
    pytest.param(lambda: external("linked/w.bin"), UnsafePathError, "leads by a link", id="linked folder"),
    pytest.param(lambda: external_in(in_attribute), UnsafePathError, "'hidden'", id="tensor in an attribute"),
    pytest.param(lambda: external_in(in_subgraph), UnsafePathError, "'hidden'", id="tensor in a subgraph"),
    pytest.param(lambda: external_in(in_function), UnsafePathError, "'hidden'", id="tensor in a function"),
    pytest.param(lambda: external_in(in_sparse_initializer), UnsafePathError, "'hidden'", id="sparse tensor"),
    pytest.param(lambda: external("*/_ORT_MEM_ADDR_/*"), CorruptFileError, "not there", id="address in memory"),
    pytest.param(lambda: external("none.bin"), CorruptFileError, "'none.bin', which is not there", id="no weights"),
    pytest.param(lambda: external("w" * 5000), CorruptFileError, "which is not there", id="name that no file can have"),
    pytest.param(lambda: external("short.bin"), TruncatedFileError, "byte 16, the file after 5", id="short weights"),
    pytest.param(lambda: external("w.bin", offset="9"), TruncatedFileError, "byte 25", id="offset too far"),
    pytest.param(lambda: external("w.bin", length="-1"), CorruptFileError, "'-1'", id="negative length"),
    pytest.param(lambda: external("w.bin", offset="x"), CorruptFileError, "'x'", id="offset that is no number"),
    pytest.param(with_operator("library", "Evil"), UnsupportedFormatError, "library::Evil", id="custom operator"),
    pytest.param(with_operator_in_subgraph, UnsupportedFormatError, "library::Evil", id="in a subgraph"),
    pytest.param(with_operator_in_function, UnsupportedFormatError, "library::Evil", id="in a function"),
    pytest.param(
        with_operator("com.microsoft", "EPContext"), UnsupportedFormatError, "EPContext", id="operator with a file"
    ),
    pytest.param(with_operator("", "NoSuch"), UnsupportedFormatError, "cannot run it", id="operator that is none"),
]


@pytest.fixture
def folder(tmp_path):
    inside = tmp_path / "models"
    inside.mkdir()
    (tmp_path / "weights.bin").write_bytes(BOX.tobytes())
    (inside / "w.bin").write_bytes(BOX.tobytes())
    (inside / "short.bin").write_bytes(b"short")
    (inside / "link.bin").symlink_to(tmp_path / "weights.bin")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "w.bin").write_bytes(BOX.tobytes())
    (inside / "linked").symlink_to(tmp_path / "elsewhere")
    return inside


@pytest.mark.parametrize(("build", "error", "match"), MODELS)
def test_models_that_are_refused(build, error, match, folder):
    path = folder / "model.onnx"
    path.write_bytes(build().SerializeToString())
    with pytest.raises(error, match=match) as caught:
        OnnxSegmenter(path)
    assert isinstance(caught.value, LdlsError)


@pytest.mark.parametrize("error", [UnsafePathError])
def test_refusal_comes_before_any_session(error, folder, monkeypatch):
    monkeypatch.setattr(onnxruntime, "InferenceSession", lambda *_, **__: pytest.fail("a session was made"))
    path = folder / "model.onnx"
    path.write_bytes(external("../weights.bin").SerializeToString())
    with pytest.raises(error):
        OnnxSegmenter(path)


@pytest.mark.parametrize("entries", [pytest.param({}, id="with length"), pytest.param({"offset": "16"}, id="offset")])
def test_weights_in_the_folder_are_fine(entries, folder):
    (folder / "w.bin").write_bytes(BOX.tobytes() * 2)
    path = folder / "model.onnx"
    path.write_bytes(external("w.bin", **entries).SerializeToString())
    assert len(OnnxSegmenter(path, threads=1)(np.zeros((20, 30, 3), np.uint8))) == 1


def test_own_functions_are_fine(tmp_path):
    model = sound_model()
    opsets = [helper.make_opsetid("", 17)]
    model.functions.append(
        helper.make_function("own", "Same", ["a"], ["b"], [helper.make_node("Identity", ["a"], ["b"])], opsets)
    )
    model.graph.node.append(helper.make_node("Same", ["image"], ["x"], domain="own"))
    model.opset_import.append(helper.make_opsetid("own", 1))
    path = graphs.save(model, tmp_path / "model.onnx")
    assert len(OnnxSegmenter(path, threads=1)(np.zeros((20, 30, 3), np.uint8))) == 1


WHOLE = sound_model().SerializeToString()


@pytest.mark.parametrize(
    ("content", "error", "match"),
    [
        pytest.param(b"", TruncatedFileError, "empty, expected an ONNX", id="empty"),
        pytest.param(WHOLE[:-1], TruncatedFileError, f"after {len(WHOLE) - 1} bytes", id="last byte missing"),
        pytest.param(WHOLE[: len(WHOLE) // 2], TruncatedFileError, "download it again", id="half"),
        pytest.param(WHOLE[:1], TruncatedFileError, "after 1 bytes", id="one byte"),
        pytest.param(b"not a model at all", CorruptFileError, "byte 0 begins no protobuf field", id="text"),
        pytest.param(b"\x89PNG\r\n\x1a\n" + bytes(50), CorruptFileError, "not an ONNX model", id="a picture"),
        pytest.param(b"version https://git-lfs.github.com/spec/v1", CorruptFileError, "git lfs pull", id="LFS pointer"),
        pytest.param(b"\x08\x08", CorruptFileError, "without a graph", id="no graph"),
        pytest.param(b"\x3a\x03\xff\xff\xff", CorruptFileError, "not an ONNX model", id="graph that is none"),
        pytest.param(bytes(8), CorruptFileError, "byte 0", id="zeros"),
    ],
)
def test_files_that_are_no_models(content, error, match, tmp_path):
    path = tmp_path / "model.onnx"
    path.write_bytes(content)
    with pytest.raises(error, match=match):
        OnnxSegmenter(path)


def test_no_cut_is_taken_for_a_whole_model(tmp_path):
    path = tmp_path / "model.onnx"
    for length in range(0, len(WHOLE), 37):
        path.write_bytes(WHOLE[:length])
        with pytest.raises((TruncatedFileError, CorruptFileError)):
            onnx_file.read_onnx(path)


def test_a_file_too_large(tmp_path, monkeypatch):
    monkeypatch.setattr(onnx_file, "MAX_BYTES", len(WHOLE) - 1)
    path = tmp_path / "model.onnx"
    path.write_bytes(WHOLE)
    with pytest.raises(LimitError, match="external data"):
        OnnxSegmenter(path)


def test_a_file_that_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError):
        OnnxSegmenter(tmp_path / "none.onnx")

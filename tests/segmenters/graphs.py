"""Small ONNX models that find objects by their colour, with the inputs and outputs of each family."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

FAR = 1e6
CLOSE = 0.08
"""Colours count as the same up to this sum of differences, channels from 0 to 1."""
N_PROTOTYPES = 32
N_CLASSES = 80


class Graph:
    """Nodes and constants as they are added, and the model they make."""

    def __init__(self):
        self.nodes, self.constants = [], []

    def constant(self, array):
        name = f"constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(array), name))
        return name

    def __call__(self, operator, *inputs, output=None, n=1, **attributes):
        names = [output or f"{operator}_{len(self.nodes)}_{k}" for k in range(n)]
        inputs = [i if isinstance(i, str) else self.constant(i) for i in inputs]
        self.nodes.append(helper.make_node(operator, inputs, names, **attributes))
        return names[0] if n == 1 else names

    def model(self, inputs, outputs, *, notes=None, opset=17):
        infos = [[helper.make_tensor_value_info(*value) for value in values] for values in (inputs, outputs)]
        graph = helper.make_graph(self.nodes, "colours", *infos, self.constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=8)
        if notes:
            helper.set_model_props(model, notes)
        return model


def save(model, path: Path) -> Path:
    onnx.save(model, path)
    return path


def find_colours(g, image, colours, size):
    """Adds the masks (K, 1, H, W), boxes (K, 4) and presence (K,) of `colours` (K, 3) in `image` (1, 3, H, W)."""
    distance = g("ReduceSum", g("Abs", g("Sub", image, colours[:, :, None, None])), np.array([1]), keepdims=1)
    near = g("Less", distance, np.float32(CLOSE))
    rows, columns = (np.arange(n, dtype=np.float32).reshape(shape) for n, shape in _axes(size))
    edges = []
    for places, pick, beyond in (
        (columns, "ReduceMin", FAR),
        (rows, "ReduceMin", FAR),
        (columns, "ReduceMax", -FAR),
        (rows, "ReduceMax", -FAR),
    ):
        edge = g(pick, g("Where", near, places, np.float32(beyond)), axes=[1, 2, 3], keepdims=0)
        edges.append(g("Add", edge, np.float32(pick == "ReduceMax")))
    masks = g("Cast", near, to=TensorProto.FLOAT)
    boxes = g("Concat", *(g("Unsqueeze", edge, np.array([1])) for edge in edges), axis=1)
    presence = g("ReduceMax", masks, axes=[1, 2, 3], keepdims=0)
    return masks, g("Clip", boxes, np.float32(0), np.float32(max(size))), presence


def _axes(size):
    return (size[0], (1, 1, -1, 1)), (size[1], (1, 1, 1, -1))


def mask_rcnn(colours, labels, scores, size, *, batched=False, cells=None, half=False, named=True):
    """Mask R-CNN as torchvision exports it, or with the masks left on grids of `cells`."""
    g = Graph()
    image = g("Cast", "image", to=TensorProto.FLOAT)
    image = image if batched else g("Unsqueeze", image, np.array([0]))
    masks, boxes, presence = find_colours(g, image, colours, size)
    names = ("boxes", "labels", "scores", "masks") if named else ("1001", "1002", "1003", "1004")
    g("Identity", boxes, output=names[0])
    g("Identity", np.asarray(labels, np.int64), output=names[1])
    g("Mul", presence, np.asarray(scores, np.float32), output=names[2])
    _draw(g, masks, boxes, len(colours), cells, names[3])
    sides = (3, *size) if not batched else (1, 3, *size)
    inputs = [("image", TensorProto.FLOAT16 if half else TensorProto.FLOAT, sides)]
    return g.model(inputs, detection_values(names, cells))


def zoo_mask_rcnn(colours, labels, scores, size):
    """Mask R-CNN as the ONNX Model Zoo ships it, for inputs of `size`: BGR less its mean."""
    g = Graph()
    mean = np.array([102.9801, 115.9465, 122.7717], np.float32)[:, None, None]
    channels = g("Split", g("Div", g("Add", "image", mean), np.float32(255)), axis=0, n=3)
    image = g("Unsqueeze", g("Concat", *channels[::-1], axis=0), np.array([0]))
    masks, boxes, presence = find_colours(g, image, colours, size)
    names = ("6568", "6570", "6572", "6887")
    g("Identity", boxes, output=names[0])
    g("Identity", np.asarray(labels, np.int64), output=names[1])
    g("Mul", presence, np.asarray(scores, np.float32), output=names[2])
    _draw(g, masks, boxes, len(colours), 28, names[3])
    return g.model([("image", TensorProto.FLOAT, (3, "height", "width"))], detection_values(names, 28))


def detection_values(names, cells):
    grid = ("height", "width") if cells is None else (cells, cells)
    return [
        (names[0], TensorProto.FLOAT, ("n", 4)),
        (names[1], TensorProto.INT64, ("n",)),
        (names[2], TensorProto.FLOAT, ("n",)),
        (names[3], TensorProto.FLOAT, ("n", 1, *grid)),
    ]


def _draw(g, masks, boxes, n, cells, output):
    if cells is None:
        g("Identity", masks, output=output)
    else:
        g(
            "RoiAlign",
            masks,
            boxes,
            np.arange(n),
            output=output,
            output_height=cells,
            output_width=cells,
            sampling_ratio=2,
            coordinate_transformation_mode="half_pixel",
        )


def yolo(colours, classes, scores, size, *, layout="yolov8", notes=None):
    """YOLO that segments: boxes with coefficients (each twice, for suppression to take one away), and prototypes."""
    g = Graph()
    masks, boxes, presence = find_colours(g, "images", colours, size)
    k = len(colours)
    logits = g("Sub", g("AveragePool", masks, kernel_shape=[4, 4], strides=[4, 4]), np.float32(0.5))
    maps = g("Transpose", logits, perm=[1, 0, 2, 3])
    g("Pad", maps, np.array([0, 0, 0, 0, 0, N_PROTOTYPES - k, 0, 0]), output="output1")
    coefficients = np.eye(k, N_PROTOTYPES, dtype=np.float32)
    sure = g("Mul", presence, np.asarray(scores, np.float32))
    column = g("Unsqueeze", sure, np.array([1]))
    if layout == "end-to-end":
        of_classes = np.asarray(classes, np.float32)[:, None]
        rows = g("Concat", boxes, column, of_classes, coefficients, axis=1)
    else:
        left, top, right, bottom = g("Split", boxes, axis=1, n=4)
        half = np.float32(0.5)
        centred = [
            g("Mul", g("Add", left, right), half),
            g("Mul", g("Add", top, bottom), half),
            g("Sub", right, left),
            g("Sub", bottom, top),
        ]
        one_hot = np.eye(N_CLASSES, dtype=np.float32)[np.asarray(classes)]
        if layout == "yolov5":
            rows = g("Concat", *centred, column, one_hot, coefficients, axis=1)
        else:
            rows = g("Concat", *centred, g("Mul", one_hot, column), coefficients, axis=1)
        # the double: a little smaller in score
        width = (4 + (layout == "yolov5")) + N_CLASSES + N_PROTOTYPES
        damped = np.ones((1, width), np.float32)
        damped[0, 4 : width - N_PROTOTYPES] = 0.95
        rows = g("Concat", rows, g("Mul", rows, damped), axis=0)
        # and boxes of no score, so that there are more boxes than numbers to a box
        rows = g("Concat", rows, np.zeros((width, width), np.float32), axis=0)
    rows = g("Transpose", rows, perm=[1, 0]) if layout == "yolov8" else rows
    g("Unsqueeze", rows, np.array([0]), output="output0")
    numbers = {"end-to-end": 6, "yolov5": 5 + N_CLASSES, "yolov8": 4 + N_CLASSES}[layout] + N_PROTOTYPES
    n = k if layout == "end-to-end" else 2 * k + numbers
    sides = (1, numbers, n) if layout == "yolov8" else (1, n, numbers)
    return g.model(
        [("images", TensorProto.FLOAT, (1, 3, *size))],
        [
            ("output0", TensorProto.FLOAT, sides),
            ("output1", TensorProto.FLOAT, (1, N_PROTOTYPES, size[0] // 4, size[1] // 4)),
        ],
        notes=notes,
    )


def constant_detections(boxes, labels, scores, masks):
    """A model that finds the same in every image: outputs as torchvision's, whatever is in the arrays."""
    g = Graph()
    names = ("boxes", "labels", "scores", "masks")
    for name, array in zip(names, (boxes, labels, scores, masks), strict=True):
        g("Identity", array, output=name)
    return g.model([("image", TensorProto.FLOAT, (3, "height", "width"))], detection_values(names, None))


def constant_yolo(rows, prototypes, *, notes=None, sides=None):
    """A model of YOLO's outputs that finds the same in every image."""
    g = Graph()
    g("Identity", rows, output="output0")
    g("Identity", prototypes, output="output1")
    outputs = [
        ("output0", TensorProto.FLOAT, sides or rows.shape),
        ("output1", TensorProto.FLOAT, (1, "mask_count", "mask_height", "mask_width") if sides else prototypes.shape),
    ]
    return g.model([("images", TensorProto.FLOAT, (1, 3, 64, 64))], outputs, notes=notes)

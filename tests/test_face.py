"""The Python face on inputs at random: only errors of ldls leave it, and layout changes no bit of a result.

`make fuzz-face` runs many more examples.
"""

import warnings

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st
from hypothesis.extra import numpy as arrays

import ldls
from conftest import pinhole
from ldls import stages

SIZE = (30, 40)
CAMERA = pinhole(30.0, (20.0, 15.0))
DTYPES = [
    "f4",
    "f8",
    ">f4",
    ">f8",
    "f2",
    "i1",
    "u2",
    "i8",
    ">i4",
    "?",
    "c8",
    "U2",
    "S3",
    "O",
    "M8[s]",
    "f4,f4,f4",
    "longdouble",
]
ODD = [0.0, -0.0, np.nan, np.inf, -np.inf, 1e-45, 1e-310, 1e7, -1e7, 1.1e7, 1e30, 1e38, 0.5]


def quiet(call, *arguments, **keywords):
    """The result of a call, or the error of ldls that left it; other errors leave here too."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return call(*arguments, **keywords)
        except ldls.InternalError:
            raise
        except ldls.LdlsError as error:
            return error


def laid_out(draw, array):
    """The values of `array` in another layout: order, strides, byte order, alignment, and flags at random."""
    layout = draw(
        st.sampled_from(["C", "F", "step", "backwards", "columns", "swapped", "odd", "field", "read-only", "list"])
    )
    if layout == "F":
        return np.asfortranarray(array)
    if layout == "step":
        return np.repeat(array, 3, axis=0)[::3]
    if layout == "backwards":
        return array[::-1, ::-1].copy()[::-1, ::-1]
    if layout == "columns":
        wide = np.zeros((array.shape[0], 2 * array.shape[1] + 1), array.dtype)
        wide[:, 1::2] = array
        return wide[:, 1::2]
    if layout == "swapped":
        return array.astype(array.dtype.newbyteorder("S"))
    if layout == "odd":
        memory = np.zeros(array.nbytes + 1, np.uint8)
        moved = memory[1:].view(array.dtype).reshape(array.shape)
        moved[...] = array
        return moved
    if layout == "field":
        records = np.zeros(array.shape, np.dtype([("flag", "u1"), ("value", array.dtype)]))
        records["value"] = array
        return records["value"]
    if layout == "read-only":
        array = array.copy()
        array.flags.writeable = False
        return array
    return array.tolist() if layout == "list" and array.dtype == np.float64 and len(array) else array


@st.composite
def clouds(draw):
    """A native, contiguous cloud, and the same values in another layout."""
    count, columns = draw(st.one_of(st.integers(0, 4), st.integers(5, 150))), draw(st.integers(3, 6))
    generator = np.random.default_rng(draw(st.integers(0, 2**32)))
    values = generator.uniform(-1, 1, (count, columns))
    # most of them in view, on a lattice in half of the clouds
    values[:, :3] = values[:, :3] * [4, 3, 2] + [0, 0, 7]
    if draw(st.booleans()):
        values = values.round()
    for odd in draw(st.lists(st.sampled_from(ODD), max_size=5)) if count else ():
        values[generator.integers(count), generator.integers(columns)] = odd
    with np.errstate(over="ignore"):
        values = values.astype(draw(st.sampled_from([np.float32, np.float64])))
    if draw(st.integers(0, 9)) == 0 and len(values):
        # stride 0: one row over and over
        return np.repeat(values[:1], len(values), axis=0), np.broadcast_to(values[:1], values.shape)
    return values, laid_out(draw, values)


@st.composite
def masks(draw):
    count = draw(st.integers(0, 4))
    boxes = [
        sorted(draw(st.lists(st.integers(0, 40), min_size=2, max_size=2)))
        + sorted(draw(st.tuples(*[st.integers(0, 30)] * 2)))
        for _ in range(count)
    ]
    return ldls.InstanceMasks.from_boxes(
        [[left, top, right, bottom] for left, right, top, bottom in boxes],
        SIZE,
        categories=draw(st.lists(st.integers(1, 3), min_size=count, max_size=count)),
    )


def bits(result):
    if isinstance(result, ldls.LdlsError):
        return type(result)
    return [getattr(result, name).tobytes() for name in ("labels", "diffused_labels", "confidence", "in_view")]


@given(clouds(), masks(), st.booleans(), st.sampled_from([ldls.Params(), ldls.Params.paper()]))
def test_any_layout_of_a_cloud_gives_the_bits_of_its_contiguous_copy_and_stays_as_it_is(
    cloud, masks, keep_origin, params
):
    native, other = cloud
    before = np.array(other, copy=True)
    expected = quiet(ldls.segment, native, masks, CAMERA, params=params, keep_origin=keep_origin)
    found = quiet(ldls.segment, other, masks, CAMERA, params=params, keep_origin=keep_origin)
    assert bits(found) == bits(expected)
    assert np.array(other).tobytes() == before.tobytes()


@given(clouds(), masks(), st.integers(1, 12))
def test_any_layout_gives_the_bits_of_the_contiguous_copy_at_every_stage(cloud, masks, k):
    native, other = cloud
    assume(np.isfinite(native[:, :3]).all() and (np.abs(native[:, :3]) <= 1e7).all())
    for stage in (
        lambda points: stages.project(points, CAMERA, image_size=SIZE),
        lambda points: stages.neighbors(points, k),
        lambda points: [stages.ground(points, CAMERA)],
        lambda points: [stages.point_graph(points, stages.neighbors(native, k)[0]).toarray()],
    ):
        assert [array.tobytes() for array in stage(other)] == [array.tobytes() for array in stage(native)]
    _, uv = stages.project(native, CAMERA, image_size=SIZE)
    moved = np.asfortranarray(uv.astype(uv.dtype.newbyteorder("S")))
    labels = stages.direct_labels(uv, masks)
    assert stages.direct_labels(moved, masks).tobytes() == labels.tobytes()
    found, expected = stages.pixel_labels(moved, masks), stages.pixel_labels(uv, masks)
    assert (found.weights != expected.weights).nnz == 0 and found.mass.tobytes() == expected.mass.tobytes()


@given(st.data())
def test_only_errors_of_ldls_leave_for_an_array_of_any_type_and_shape(data):
    shape = data.draw(
        st.one_of(st.tuples(st.integers(0, 5), st.integers(0, 5)), arrays.array_shapes(min_dims=0, max_side=4))
    )
    dtype = np.dtype(data.draw(st.sampled_from(DTYPES)))
    array = data.draw(arrays.arrays(dtype, shape)) if dtype.kind in "fiubcUS" else np.zeros(shape, dtype)
    if data.draw(st.booleans()):
        array = array.T[::-1] if array.ndim else array
    small = ldls.InstanceMasks.from_array([np.eye(4)])
    for call in (
        lambda: ldls.segment(array, small, CAMERA),
        lambda: stages.project(array, CAMERA, image_size=SIZE),
        lambda: stages.neighbors(array),
        lambda: stages.ground(array, CAMERA),
        lambda: stages.direct_labels(array, small),
        lambda: stages.pixel_labels(array, small),
        lambda: stages.confidence(array, np.zeros(len(array) if array.ndim else 0, int), small),
        lambda: stages.point_graph(np.zeros((3, 3)), array),
        lambda: ldls.InstanceMasks.from_array(array),
        lambda: ldls.InstanceMasks.from_array(array, image_size=(4, 4), instance_axis=-1),
        lambda: ldls.InstanceMasks.from_instance_image(array),
        lambda: ldls.InstanceMasks.from_instance_image(array, class_divisor=7),
        lambda: ldls.InstanceMasks.from_boxes(array, SIZE),
        lambda: ldls.InstanceMasks.from_array([np.eye(4)], categories=array),
        lambda: ldls.InstanceMasks.from_array([np.eye(4)], scores=array),
        lambda: small.select(array),
        lambda: ldls.Camera(projection=array),
        lambda: ldls.Camera(projection=np.eye(3), T_camera_lidar=array),
        lambda: ldls.Distortion.from_opencv(array),
        lambda: ldls.labeling.Labeling(array, array, array, ("background", "car")),
        lambda: ldls.labeling.Labeling.from_codes(array, {0: "background", 3: "car"}),
    ):
        quiet(call)


@given(
    arrays.arrays(np.float64, (3, 4), elements=st.floats()),
    arrays.arrays(np.float64, (4, 4), elements=st.floats()),
    clouds(),
)
def test_any_camera_is_refused_as_such_or_projects(projection, transform, cloud):
    for arguments in ({"projection": projection}, {"projection": CAMERA.projection, "T_camera_lidar": transform}):
        camera = quiet(ldls.Camera, **arguments)
        if isinstance(camera, ldls.LdlsError):
            assert isinstance(camera, ldls.CalibrationError)
            continue
        found = quiet(stages.project, cloud[0], camera, image_size=SIZE)
        if not isinstance(found, ldls.LdlsError):
            in_view, uv = found
            assert ((uv >= -0.5) & (uv <= (SIZE[1] - 0.5, SIZE[0] - 0.5))).all() and len(uv) == len(in_view)


PARAMETERS = st.fixed_dictionaries(
    {},
    optional={
        name: st.one_of(
            st.integers(),
            st.integers(-1, 40),
            st.floats(),
            st.floats(0, 1),
            st.booleans(),
            st.none(),
            st.text(max_size=3),
        )
        for name in vars(ldls.Params())
        if name != "threads"
    },
)


@given(PARAMETERS, clouds(), masks())
def test_params_of_any_value_are_refused_or_serve(parameters, cloud, masks):
    params = quiet(ldls.Params, **parameters)
    if isinstance(params, ldls.LdlsError):
        assert isinstance(params, ldls.ParameterError)
        return
    if params.iterations is not None:
        assume(params.iterations < 10_000)
    result = quiet(ldls.segment, cloud[0], masks, CAMERA, params=params)
    if not isinstance(result, ldls.LdlsError):
        assert ((result.confidence >= 0) & (result.confidence <= 1)).all()
        assert ((result.labels >= -1) & (result.labels <= len(masks))).all()


@given(
    arrays.arrays(st.sampled_from(["?", "u1", "i2", "f4", "f8", ">u2"]), (2, 5, 7), elements=st.sampled_from([0, 1])),
    st.data(),
)
def test_any_layout_of_masks_gives_the_same_runs(pixels, data):
    expected = ldls.InstanceMasks.from_array(pixels)
    layouts = [laid_out(data.draw, mask) for mask in pixels]
    before = [np.array(mask, copy=True) for mask in layouts]
    found = ldls.InstanceMasks.from_array(layouts)
    assert [mask.rle.runs().tolist() for mask in found] == [mask.rle.runs().tolist() for mask in expected]
    assert all(np.array_equal(mask, copy) for mask, copy in zip(layouts, before, strict=True))


@pytest.mark.parametrize("size", [0, 1, 2, 11])
def test_empty_arrays_after_pickling_are_taken(size):
    import pickle

    points = pickle.loads(pickle.dumps(np.zeros((size, 3)), protocol=5))
    assert ldls.segment(points, ldls.InstanceMasks.from_boxes([], SIZE), CAMERA).labels.shape == (size,)

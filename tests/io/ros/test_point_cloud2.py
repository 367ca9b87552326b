"""PointCloud2 to arrays and back, however the bytes lie."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

pytest.importorskip("rosbags")

from ldls.errors import CorruptFileError, FileFormatError, InputError, UnsupportedFormatError
from ldls.io.ros.messages import Header, read_header, serialize, standard_types
from ldls.io.ros.point_cloud2 import DATATYPES, POINTS, decode, encode

NUMBERS = {kind: number for number, kind in DATATYPES.items()}
XYZ = (("x", "f4"), ("y", "f4"), ("z", "f4"))


def message(cloud, *, big_endian=False, gaps=0, row_padding=0, height=1):
    """A message of a structured array, with `gaps` bytes before every field and `row_padding` after every row."""
    order, fields, offset = "><"[not big_endian], [], 0
    for name in cloud.dtype.names:
        kind = cloud.dtype[name]
        offset += gaps
        fields.append(SimpleNamespace(name=name, offset=offset, datatype=NUMBERS[kind.str[1:]], count=1))
        offset += kind.itemsize
    width = len(cloud) // height
    layout = np.dtype(
        {
            "names": list(cloud.dtype.names),
            "formats": [order + cloud.dtype[name].str[1:] for name in cloud.dtype.names],
            "offsets": [field.offset for field in fields],
            "itemsize": offset,
        }
    )
    rows = np.zeros((height, width * offset + row_padding), np.uint8)
    rows[:, : width * offset] = cloud.astype(layout).view(np.uint8).reshape(height, -1)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=5, nanosec=7), frame_id="lidar"),
        height=height,
        width=width,
        fields=fields,
        is_bigendian=big_endian,
        point_step=offset,
        row_step=rows.shape[1],
        data=rows.reshape(-1),
        is_dense=False,
    )


def cloud_of(count, columns=XYZ, seed=0):
    generator = np.random.default_rng(seed)
    cloud = np.zeros(count, list(columns))
    for name, _ in columns:
        cloud[name] = generator.integers(0, 100, count)
    return cloud


@pytest.mark.parametrize(
    ("field", "kind", "values", "name", "expected"),
    [
        pytest.param("time", "f4", [-0.05, 0.05], None, [-0.05, 0.05], id="Velodyne"),
        pytest.param("t", "u4", [0, 99_000_000], None, [0, 0.099], id="Ouster"),
        pytest.param("offset_time", "u4", [0, 99_000_000], None, [0, 0.099], id="Livox"),
        pytest.param("time_offset", "i4", [-5_000, 0], None, [-5e-6, 0], id="nanoseconds before the stamp"),
        pytest.param("timestamp", "f8", [5.0, 5.1], None, [-7e-9, 0.1 - 7e-9], id="Hesai, Robosense"),
        pytest.param("timestamp", "f4", [5.0, 5.1], None, None, id="single precision holds no time since 1970"),
        pytest.param("time", "u2", [0, 9], None, None, id="too small for times"),
        pytest.param("stamp", "f4", [0, 9], None, None, id="an unknown name"),
        pytest.param("stamp", "f4", [0, 0.1], "stamp", [0, 0.1], id="a name that is given"),
        pytest.param("time", "f4", [0, 0.1], "", None, id="no field that is given"),
        pytest.param("time", "f4", [0, 0.1], "t", None, id="another name that is given"),
    ],
)
def test_times_of_points_are_seconds_after_the_stamp(field, kind, values, name, expected):
    cloud = np.zeros(2, [*XYZ, (field, kind)])
    cloud[field] = values
    times = decode(message(cloud)).times(name)
    if expected is None:
        assert times is None
    else:
        assert times.dtype == np.float64
        np.testing.assert_allclose(times, expected, atol=2e-9)


def test_nanoseconds_since_1970_are_told_from_seconds():
    cloud = np.zeros(2, [*XYZ, ("timestamp", "f8")])
    # a missing return has none
    cloud["timestamp"] = [0, 1.7e18 + 50_000_000]
    since_1970 = message(cloud)
    since_1970.header.stamp.sec, since_1970.header.stamp.nanosec = 1_700_000_000, 0
    assert decode(since_1970).times()[1] == pytest.approx(0.05, abs=3e-7)
    cloud["timestamp"] = [0, 1.7e9 + 0.05]
    in_seconds = message(cloud)
    in_seconds.header.stamp.sec, in_seconds.header.stamp.nanosec = 1_700_000_000, 0
    assert decode(in_seconds).times()[1] == pytest.approx(0.05, abs=3e-7)


@settings(max_examples=60)
@given(
    columns=st.lists(st.sampled_from(sorted(NUMBERS)), max_size=4),
    position=st.sampled_from(["f4", "f8"]),
    rows=st.integers(0, 4),
    width=st.integers(0, 5),
    big_endian=st.booleans(),
    gaps=st.integers(0, 5),
    row_padding=st.integers(0, 9),
)
def test_fields_come_out_wherever_they_lie(columns, position, rows, width, big_endian, gaps, row_padding):
    names = [*((name, position) for name in "xyz"), *((f"field{k}", kind) for k, kind in enumerate(columns))]
    cloud = cloud_of(rows * width, names)
    found = decode(message(cloud, big_endian=big_endian, gaps=gaps, row_padding=row_padding, height=max(rows, 1)))
    for name, _ in names:
        np.testing.assert_array_equal(found.fields[name], cloud[name])
        assert found.fields.dtype[name].isnative
    assert found.header == Header(5_000_000_007, "lidar")
    assert found.points().dtype == np.dtype(position)


@pytest.mark.parametrize("ros2", [False, True], ids=["ROS 1", "ROS 2"])
def test_what_is_encoded_comes_back(ros2):
    types = standard_types(ros2=ros2)
    columns = {
        "x": np.array([1.5, np.nan, 3], np.float32),
        "y": np.array([4, 5, 6], np.float64),
        "z": np.array([7, 8, 9], np.float32),
        "ring": np.array([1, 2, 65535], np.uint16),
        "class_id": np.array([0, 1, 255], np.uint8),
    }
    raw = serialize(types, encode(types, columns, Header(12_000_000_034, "velodyne")), POINTS, ros2=ros2)
    assert read_header(raw, ros2=ros2) == Header(12_000_000_034, "velodyne")
    back = (types.deserialize_cdr if ros2 else types.deserialize_ros1)(raw, POINTS)
    found = decode(back)
    assert not back.is_dense and found.header.frame_id == "velodyne"
    for name, column in columns.items():
        np.testing.assert_array_equal(found.fields[name], column)


@pytest.mark.parametrize("ros2", [False, True], ids=["ROS 1", "ROS 2"])
def test_no_points_are_points(ros2):
    types = standard_types(ros2=ros2)
    empty = encode(types, {name: np.zeros(0, np.float32) for name in "xyz"}, Header(0, ""))
    assert decode(empty).points().shape == (0, 3)


def test_headers_of_big_endian_messages_are_read():
    types = standard_types(ros2=True)
    empty = encode(types, {name: np.zeros(0, np.float32) for name in "xyz"}, Header(3_000_000_004, "far"))
    raw = bytes(types.serialize_cdr(empty, POINTS, little_endian=False))
    assert read_header(raw, ros2=True) == Header(3_000_000_004, "far")
    with pytest.raises(CorruptFileError, match="message of 9 bytes"):
        read_header(raw[:9], ros2=True)
    with pytest.raises(CorruptFileError, match="its frame_id alone has 4"):
        read_header(raw[:17], ros2=True)


def changed(**changes):
    changed_message = message(cloud_of(6), height=2)
    for name, value in changes.items():
        setattr(changed_message, name, value)
    return changed_message


def renamed(**changes):
    changed_message = changed()
    for name, value in changes.items():
        setattr(changed_message.fields[2], name, value)
    return changed_message


ROWS = [
    pytest.param(changed(data=np.zeros(71, np.uint8)), CorruptFileError, "71 bytes, expected 72", id="too few bytes"),
    pytest.param(changed(row_step=35), CorruptFileError, "row_step is 35", id="rows that overlap"),
    pytest.param(changed(width=2**31), CorruptFileError, "expected", id="a width that lies"),
    pytest.param(renamed(offset=9), CorruptFileError, "'z' at byte 9 reaches beyond", id="a field beyond the point"),
    pytest.param(renamed(datatype=9), UnsupportedFormatError, "'z' has type 9", id="an unknown type"),
    pytest.param(renamed(name="y"), CorruptFileError, "each name once", id="a name twice"),
    pytest.param(renamed(name="h"), FileFormatError, "field 'z'.*found x float32, y float32, h", id="z renamed"),
    pytest.param(renamed(datatype=5), FileFormatError, "field 'z'.*z int32", id="z in whole numbers"),
    pytest.param(renamed(count=3, datatype=2), FileFormatError, "field 'z'", id="z an array"),
]


@pytest.mark.parametrize(("broken", "error", "match"), ROWS)
def test_what_makes_no_sense_is_refused(broken, error, match):
    with pytest.raises(error, match=match):
        decode(broken).points()


def test_padding_that_pcl_names_underscore_is_no_field():
    padded = changed()
    padded.fields += [SimpleNamespace(name="_", offset=0, datatype=2, count=4)] * 2
    assert decode(padded).fields.dtype == decode(changed()).fields.dtype


def test_columns_must_fit_together():
    types = standard_types(ros2=True)
    with pytest.raises(InputError, match="one length"):
        encode(types, {"x": np.zeros(2), "y": np.zeros(3)}, Header(0, ""))
    with pytest.raises(InputError, match="'x' is int64"):
        encode(types, {"x": np.zeros(2, np.int64)}, Header(0, ""))

"""Files hold each annotation context once and for all times, streams hold them for their times."""

import numpy as np
import pytest

import ldls
from ldls.viewing.recording import Recording, open_recording
from viewing.recorded import Recorded

rr = pytest.importorskip("rerun")
PLACES = ("world", r"world/camera/camera\ 0/image/masks")
CONTEXT = "AnnotationContext:context"


@pytest.fixture
def results(small_scene):
    """Two frames, the second with a category that the first does not have."""
    points, masks, camera = small_scene
    other = ldls.InstanceMasks.from_array(masks.to_array(), categories=[1, 18])
    return [ldls.segment(points, each, camera) for each in (masks, other)]


def contexts(rrd, place):
    return [row.times for row in rrd.each(place, CONTEXT)]


def test_a_file_has_one_context_a_place_and_it_has_all_names(results, tmp_path) -> None:
    with open_recording(tmp_path / "a.rrd") as recording:
        for result in results:
            recording.add(result)
    rrd = Recorded(tmp_path / "a.rrd")
    for place in PLACES:
        assert contexts(rrd, place) == [{}]
    assert {name for name, _ in rrd.names("world").values()} >= {"person", "car", "dog", "car 2", "dog 2"}


def test_frames_that_number_classes_each_in_their_own_way_have_their_names(small_scene, tmp_path) -> None:
    points, masks, camera = small_scene
    with open_recording(tmp_path / "a.rrd") as recording:
        for names in ({100: "cone", 101: "sign"}, {100: "drum", 101: "cone"}):
            named = ldls.InstanceMasks.from_array(masks.to_array(), categories=[100, 101], names=names)
            recording.add(ldls.segment(points, named, camera))
    names = Recorded(tmp_path / "a.rrd").names("world")
    assert [names[category, None][0] for category in (100, 101, 102)] == ["cone", "sign", "drum"]


def test_a_stream_has_contexts_at_their_times(results, tmp_path) -> None:
    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "a.rrd")
    recording = Recording(stream, contexts="timed")
    for number, result in enumerate(results):
        stream.set_time("frame", sequence=number)
        recording.log_result(result)
    stream.disconnect()
    rrd = Recorded(tmp_path / "a.rrd")
    for place in PLACES:
        assert [times["frame"] for times in contexts(rrd, place)] == [0, 1]


def test_a_recording_of_ones_own_has_them_for_all_times(results, tmp_path) -> None:
    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "a.rrd")
    Recording(stream).log_result(results[0])
    stream.disconnect()
    for place in PLACES:
        assert contexts(Recorded(tmp_path / "a.rrd"), place) == [{}]


def test_contexts_of_ones_own_recording_can_be_held_back(results, tmp_path) -> None:
    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "a.rrd")
    recording = Recording(stream, contexts="held")
    for result in results:
        recording.log_result(result)
    recording.log_held_contexts()
    stream.disconnect()
    rrd = Recorded(tmp_path / "a.rrd")
    assert [contexts(rrd, place) for place in PLACES] == [[{}], [{}]]
    assert {name for name, _ in rrd.names("world").values()} >= {"car", "dog"}


def test_a_camera_that_comes_later_has_a_context_too(small_scene, tmp_path) -> None:
    points, masks, camera = small_scene
    with open_recording(tmp_path / "a.rrd") as recording:
        for name in ("left", "right"):
            recording.add(ldls.segment(points, [ldls.View(masks, camera, name)]))
    rrd = Recorded(tmp_path / "a.rrd")
    for name in ("left", "right"):
        assert contexts(rrd, f"world/camera/{name}/image/masks") == [{}]


def test_recordings_and_entities_have_names_of_their_own(small_scene, tmp_path) -> None:
    points, masks, camera = small_scene
    swapped = ldls.InstanceMasks.from_array(masks.to_array(), categories=[3, 1])
    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "a.rrd")
    recording = Recording(stream)
    recording.log_result(ldls.segment(points, masks, camera), entity="a")
    recording.log_result(ldls.segment(points, swapped, camera), entity="b")
    Recording(stream).log_result(ldls.segment(points, swapped, camera), entity="c")
    stream.disconnect()
    rrd = Recorded(tmp_path / "a.rrd")
    for entity, expected in (("a", {"person 1", "car 2"}), ("b", {"car 1", "person 2"}), ("c", {"car 1", "person 2"})):
        assert {name for name, _ in rrd.names(rf"{entity}/camera/camera\ 0/image/masks").values()} == {
            "background", *expected,
        }  # fmt: skip


def test_an_unknown_way_to_log_contexts_is_refused() -> None:
    with pytest.raises(ldls.ParameterError, match="contexts: got 'late', expected one of static, timed, held"):
        Recording(rr.RecordingStream("test"), contexts="late")


def test_what_fails_leaves_no_file(results, tmp_path) -> None:
    with pytest.raises(ldls.InputError), open_recording(tmp_path / "a.rrd") as recording:
        recording.add(results[0])
        recording.add(results[1], images={"camera 0": np.zeros((2, 2, 3), np.uint8)})
    assert not list(tmp_path.iterdir())

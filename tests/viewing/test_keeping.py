"""Files hold each annotation context once and for all times, streams hold them for their times."""

import numpy as np
import pytest

import ldls
from ldls.viewing.recording import log, open_recording
from ldls.viewing.recording.keeping import at_their_times
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


def contexts(found, place):
    return [row.times for row in found.each(place, CONTEXT)]


def test_a_file_has_one_context_a_place_and_it_has_all_names(results, tmp_path) -> None:
    with open_recording(tmp_path / "a.rrd") as recording:
        for result in results:
            recording.add(result)
    found = Recorded(tmp_path / "a.rrd")
    for place in PLACES:
        assert contexts(found, place) == [{}]
    assert {name for name, _ in found.names("world").values()} >= {"person", "car", "dog", "car 2", "dog 2"}


def test_a_stream_has_contexts_at_their_times(results, tmp_path) -> None:
    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "a.rrd")
    with at_their_times(stream):
        for number, result in enumerate(results):
            stream.set_time("frame", sequence=number)
            log(result, recording=stream)
    stream.disconnect()
    found = Recorded(tmp_path / "a.rrd")
    for place in PLACES:
        assert [times["frame"] for times in contexts(found, place)] == [0, 1]


def test_a_recording_of_ones_own_has_them_for_all_times(results, tmp_path) -> None:
    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "a.rrd")
    log(results[0], recording=stream)
    stream.disconnect()
    for place in PLACES:
        assert contexts(Recorded(tmp_path / "a.rrd"), place) == [{}]


def test_what_fails_leaves_no_file(results, tmp_path) -> None:
    with pytest.raises(ldls.InputError), open_recording(tmp_path / "a.rrd") as recording:
        recording.add(results[0])
        recording.add(results[1], images={"camera 0": np.zeros((2, 2, 3), np.uint8)})
    assert not list(tmp_path.iterdir())

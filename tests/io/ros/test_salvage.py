"""Bags cut off at many places: every message that is whole comes out, as it was."""

import warnings
from collections import Counter
from contextlib import suppress

import pytest

pytest.importorskip("rosbags")

from datasets.ros_samples import Recording, messages, storage
from ldls.errors import FileFormatError, RecoveredFileWarning
from ldls.io.ros.bags import open_bag


def cuts(size):
    """Places all over a file, next to the borders of pages, and close together at both ends."""
    borders = {page * 4096 + shift for page in range(1, size // 4096 + 1) for shift in (-1, 0, 1)}
    return sorted(
        c for c in {*range(0, size, 1499), *range(0, 130, 13), *borders, size - 40, size - 9, size - 1} if c < size
    )


@pytest.mark.parametrize("kind", ["rosbag1", "rosbag2", "mcap"])
def test_a_bag_cut_anywhere_keeps_its_whole_messages(tmp_path, kind):
    whole = Recording(kind=kind, sweeps=2).write(tmp_path / ("whole.bag" if kind == "rosbag1" else "whole"))
    recorded, content = messages(whole), storage(whole).read_bytes()
    ends = [content.find(raw) + len(raw) for _, _, raw in recorded]
    path = tmp_path / f"cut{storage(whole).suffix}"
    counted = []
    for cut in cuts(len(content)):
        path.write_bytes(content[:cut])
        with pytest.raises(FileFormatError, match="cut") as refused:
            open_bag(path)
        with pytest.warns(RecoveredFileWarning, match=f"{path.name}: .*whole messages before it"):
            recovered = messages(path, recover=True)
        assert not Counter(recovered) - Counter(recorded)
        if kind != "rosbag2":
            # a database keeps long messages in pages all over the file
            assert len(recovered) == sum(end <= cut for end in ends)
        assert ("pass recover=True" in str(refused.value)) == bool(recovered)
        counted.append(len(recovered))
    assert counted == sorted(counted) and counted[0] == 0 and counted[-1] >= len(recorded) - 1


@pytest.mark.parametrize("kind", ["rosbag1", "rosbag2", "mcap"])
def test_blank_pages_at_the_end_are_a_fault_of_the_file(tmp_path, kind):
    whole = Recording(kind=kind, sweeps=2).write(tmp_path / ("whole.bag" if kind == "rosbag1" else "whole"))
    content = storage(whole).read_bytes()
    path = tmp_path / f"cut{storage(whole).suffix}"
    for cut in range(4096, len(content), 4096):
        path.write_bytes(content[:cut] + bytes(8192))
        with warnings.catch_warnings(), suppress(FileFormatError):
            warnings.simplefilter("ignore", RecoveredFileWarning)
            messages(path, recover=True)

import numpy as np
import pytest

from evaluation.samples import labeling
from ldls.errors import CorruptFileError
from ldls.io.labels.annotations import read_annotations, write_annotations


def test_round_trip(tmp_path):
    write_annotations(tmp_path / "a.txt", labeling([0, 1, 1, 2, 1], [0, 1, 2, 1, 3], ignored=[4]))
    assert (tmp_path / "a.txt").read_text() == "0 background\n1 Car\n2 Car\n1 Pedestrian\n0 DontCare\n"
    found = read_annotations(tmp_path / "a.txt")
    assert found.names == ("background", "Car", "Pedestrian", "DontCare")
    assert found.classes.tolist() == [0, 1, 1, 2, 3]
    assert found.instances.tolist() == [0, 1, 2, 1, 0]
    assert not found.ignored.any()


def test_what_people_write_is_read(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"\xef\xbb\xbf-1 DontCare\r\n2\tCar\r\n 1  potted plant \r\n\r\n")
    (tmp_path / "a.txt").write_bytes((tmp_path / "a.txt").read_bytes().replace(b"\t", b" "))
    found = read_annotations(tmp_path / "a.txt")
    assert [found.names[c] for c in found.classes] == ["DontCare", "Car", "potted plant"]
    assert found.instances.tolist() == [0, 2, 1]


def test_an_empty_file_labels_no_point(tmp_path):
    (tmp_path / "a.txt").write_text("")
    assert len(read_annotations(tmp_path / "a.txt")) == 0


def test_a_whole_cloud_keeps_its_order(tmp_path):
    generator = np.random.default_rng(5)
    classes = generator.integers(0, 3, 120_000)
    source = labeling(classes, np.where(classes > 0, generator.integers(0, 9, classes.size), 0))
    write_annotations(tmp_path / "a.txt", source)
    found = read_annotations(tmp_path / "a.txt")
    order = np.array([source.names.index(name) for name in found.names])
    np.testing.assert_array_equal(order[found.classes], source.classes)
    np.testing.assert_array_equal(found.instances, source.instances)


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        pytest.param("Car 1", "'Car 1'", id="swapped"),
        pytest.param("1", "'1'", id="no class"),
        pytest.param("-2 Car", "'-2 Car'", id="instance below -1"),
        pytest.param("1.5 Car", "'1.5 Car'", id="fraction"),
        pytest.param("9999999999 Car", "'9999999999 Car'", id="huge instance"),
        pytest.param("", "''", id="blank line"),
    ],
)
def test_broken_lines_are_named(tmp_path, line, shown):
    (tmp_path / "a.txt").write_text(f"1 Car\n{line}\n1 Car\n")
    with pytest.raises(CorruptFileError, match="a.txt, line 2: expected 'instance class'") as caught:
        read_annotations(tmp_path / "a.txt")
    assert str(caught.value).endswith(f"got {shown}")


def test_binary_files_are_refused(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"1 Car\n\xff\xfe")
    with pytest.raises(CorruptFileError, match="not a text file .* at byte 6"):
        read_annotations(tmp_path / "a.txt")

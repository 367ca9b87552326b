import json
import tracemalloc
import zlib

import numpy as np
import pytest
from PIL import Image

import ldls
from mask_samples import png, random_masks

NUMBERS = np.array([[0, 7, 7, 0], [3, 3, 7, 0], [0, 0, 0, 200]], np.uint8)


def read(path, **options):
    return ldls.read_masks(path, **options)


def rows(values):
    """Image data of a PNG: each row after a byte that says that it is not filtered."""
    return b"".join(b"\0" + row.tobytes() for row in values)


def chunk(**content):
    whole = {"version": 1, "categories": [1] * 200, "scores": [1.0] * 200, "names": {"1": "object"}} | content
    return [(b"tEXt", b"ldls:instances\0" + json.dumps(whole).encode())]


def test_numbers_of_other_programs_become_objects_in_their_order(tmp_path):
    Image.fromarray(NUMBERS).save(tmp_path / "numbers.png")
    masks = read(tmp_path / "numbers.png")
    np.testing.assert_array_equal(masks.to_array(), [NUMBERS == 3, NUMBERS == 7, NUMBERS == 200])
    assert [(mask.category, mask.name, mask.score) for mask in masks] == [(1, "object", 1.0)] * 3
    masks = read(tmp_path / "numbers.png", categories=[3, 1, 18], scores=[0.5, 0.25, 1])
    assert [(mask.name, mask.score) for mask in masks] == [("car", 0.5), ("person", 0.25), ("dog", 1.0)]
    assert [mask.name for mask in read(tmp_path / "numbers.png", categories=3)] == ["car"] * 3


def test_kitti_keeps_the_class_in_the_upper_byte(tmp_path):
    values = np.array([[0, 26 * 256 + 1], [26 * 256 + 2, 24 * 256 + 1], [21 * 256, 0]], np.uint16)
    Image.fromarray(values).save(tmp_path / "kitti.png")
    masks = read(tmp_path / "kitti.png", class_divisor=256, names={26: "car"})
    np.testing.assert_array_equal(masks.to_array(), [values == v for v in (24 * 256 + 1, 26 * 256 + 1, 26 * 256 + 2)])
    assert [(mask.category, mask.name) for mask in masks] == [(24, "class 24"), (26, "car"), (26, "car")]


def test_a_class_0_in_the_upper_byte_is_refused(tmp_path):
    Image.fromarray(NUMBERS).save(tmp_path / "numbers.png")
    with pytest.raises(ldls.MaskError, match=r"numbers\.png: mask 0: category is 0, expected 1 or more"):
        read(tmp_path / "numbers.png", class_divisor=256)


def palette_image():
    image = Image.frombytes("P", (4, 3), NUMBERS.tobytes())
    image.putpalette(np.random.default_rng(0).integers(0, 5, 768).astype(np.uint8).tobytes())
    return image


@pytest.mark.parametrize(
    "save",
    [
        pytest.param(lambda path: palette_image().save(path), id="palette with equal colours"),
        pytest.param(lambda path: palette_image().save(path, transparency=7), id="palette with a clear colour"),
        pytest.param(lambda path: Image.fromarray(NUMBERS.astype(np.uint16) * 256).save(path), id="16 bits"),
        pytest.param(lambda path: Image.fromarray(NUMBERS).save(path, transparency=7), id="a clear grey"),
        pytest.param(lambda path: path.write_bytes(interlaced()), id="interlaced"),
    ],
)
def test_variants_of_png_keep_the_instances(tmp_path, save):
    save(tmp_path / "numbers.png")
    expected = [NUMBERS == 3, NUMBERS == 7, NUMBERS == 200]
    np.testing.assert_array_equal(read(tmp_path / "numbers.png").to_array(), expected)


def interlaced():
    """Adam7: the pixels in seven passes of ever finer grids."""
    passes = [(0, 8, 0, 8), (0, 8, 4, 8), (4, 8, 0, 4), (0, 4, 2, 4), (2, 4, 0, 2), (0, 2, 1, 2), (1, 2, 0, 1)]
    grids = (NUMBERS[top::down, left::right] for top, down, left, right in passes)
    return png(4, 3, image_data=b"".join(rows(grid) for grid in grids if grid.size), interlace=1)


def test_one_bit_is_one_instance(tmp_path):
    Image.fromarray(NUMBERS > 0).save(tmp_path / "mask.png")
    np.testing.assert_array_equal(read(tmp_path / "mask.png").to_array(), [NUMBERS > 0])


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "LA"])
def test_colours_are_refused_by_name(tmp_path, mode):
    Image.fromarray(NUMBERS).convert(mode).save(tmp_path / "picture.png")
    with pytest.raises(ldls.UnsupportedFormatError, match=rf"picture\.png: {mode} pixels, expected one number a pixel"):
        read(tmp_path / "picture.png")


WHOLE = png(4, 3, image_data=rows(NUMBERS))
FLIPPED = WHOLE.replace(b"IDAT", b"IDAT", 1)[:-20] + bytes([WHOLE[-20] ^ 1]) + WHOLE[-19:]


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        pytest.param(WHOLE[:-30], ldls.CorruptFileError, "not a whole PNG", id="truncated in its pixels"),
        pytest.param(WHOLE[:30], ldls.CorruptFileError, "not a whole PNG", id="truncated in its header"),
        pytest.param(b"", ldls.CorruptFileError, "not a whole PNG", id="empty"),
        pytest.param(b"\xff\xd8\xff\xe0" + bytes(99), ldls.CorruptFileError, "not a whole PNG", id="JPEG"),
        pytest.param(FLIPPED, ldls.CorruptFileError, "not a whole PNG", id="one bit flipped"),
        pytest.param(png(1, 10**9), ldls.LimitError, "1000000000 x 1 pixels", id="1 x 10^9"),
        pytest.param(png(32_000, 32_000), ldls.LimitError, "at most 178956970", id="bomb"),
        pytest.param(png(0, 3), ldls.CorruptFileError, "not a whole PNG", id="no columns"),
        pytest.param(
            png(4, 3, image_data=rows(NUMBERS), chunks=chunk(categories=[1] * 199, scores=[1] * 199)),
            ldls.CorruptFileError,
            "value 200, but text chunk ldls:instances describes 199",
            id="more values than instances",
        ),
        pytest.param(
            png(4, 3, image_data=rows(NUMBERS), chunks=chunk(version=2)),
            ldls.UnsupportedFormatError,
            "version 2, this ldls reads 1",
            id="later version",
        ),
        pytest.param(
            png(4, 3, image_data=rows(NUMBERS), chunks=chunk(scores=[2] * 200)),
            ldls.MaskError,
            "mask 0: score is 2",
            id="score 2 in the chunk",
        ),
        pytest.param(
            png(4, 3, image_data=rows(NUMBERS), chunks=chunk(scores=[])),
            ldls.MaskError,
            "scores: expected one for each of 200",
            id="scores missing in the chunk",
        ),
        pytest.param(
            png(4, 3, image_data=rows(NUMBERS), chunks=chunk(names=3)),
            ldls.CorruptFileError,
            "not a whole text chunk ldls:instances",
            id="names that are none",
        ),
        pytest.param(
            png(4, 3, image_data=rows(NUMBERS), chunks=[(b"tEXt", b"ldls:instances\0" + b"[" * 100_000)]),
            ldls.CorruptFileError,
            "not a whole text chunk ldls:instances",
            id="nested text chunk",
        ),
        pytest.param(
            png(4, 3, image_data=rows(NUMBERS), chunks=[(b"tEXt", b"ldls:instances\0[]")]),
            ldls.CorruptFileError,
            "not a whole text chunk ldls:instances",
            id="list as text chunk",
        ),
        pytest.param(
            png(4, 3, image_data=rows(NUMBERS), chunks=[(b"zTXt", b"a\0\0" + zlib.compress(bytes(1 << 26)))]),
            ldls.CorruptFileError,
            "not a whole PNG",
            id="bomb of text",
        ),
    ],
)
def test_faults_of_png_files_are_named(tmp_path, content, error, message):
    path = tmp_path / "numbers.png"
    path.write_bytes(content)
    with pytest.raises(error, match=message) as caught:
        read(path)
    assert "numbers.png" in str(caught.value)


def test_a_bomb_of_44_kb_is_refused_before_it_is_unpacked(tmp_path):
    packer = zlib.compressobj(9)
    packed = b"".join(packer.compress(bytes(1 << 20)) for _ in range(44)) + packer.flush()
    path = tmp_path / "bomb.png"
    path.write_bytes(png(32_000, 32_000).replace(zlib.compress(b""), packed))
    assert 40_000 < path.stat().st_size < 48_000
    tracemalloc.start()
    with pytest.raises(ldls.LimitError, match=r"bomb\.png: 32000 x 32000 pixels"):
        read(path)
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()


def test_a_large_image_within_the_limit_warns_of_nothing(tmp_path):
    path = tmp_path / "large.png"
    Image.new("1", (9_500, 9_500)).save(path)  # over the size from which Pillow warns
    assert len(read(path)) == 0


def test_overlaps_are_refused_with_the_mend(tmp_path):
    masks = random_masks(5)
    with pytest.raises(
        ldls.MaskError, match=r"masks of labels [1-9] and [1-9] share pixel \(\d+, \d+\).*resolve_overlaps"
    ):
        ldls.save(masks, tmp_path / "masks.png")
    assert list(tmp_path.iterdir()) == []
    ldls.save(masks.resolve_overlaps(), tmp_path / "masks.png")


def test_what_the_file_says_is_not_said_again(tmp_path):
    ldls.save(random_masks(5).resolve_overlaps(), tmp_path / "masks.png")
    with pytest.raises(ldls.ParameterError, match="holds its own categories; leave out categories="):
        read(tmp_path / "masks.png", categories=[1])


@pytest.mark.parametrize(("count", "mode"), [(255, "L"), (256, "I;16"), (65_535, "I;16")])
def test_bits_are_chosen_by_the_number_of_instances(tmp_path, count, mode):
    pixels = np.eye(4, dtype=bool)
    last, empty = (ldls.InstanceMasks.from_array([p])[0].rle for p in (pixels, ~pixels & pixels))
    masks = ldls.InstanceMasks([empty] * (count - 1) + [last], (4, 4))
    ldls.save(masks, tmp_path / "masks.png")
    with Image.open(tmp_path / "masks.png") as image:
        assert image.mode == mode
        np.testing.assert_array_equal(np.asarray(image), count * pixels)
    found = read(tmp_path / "masks.png")
    assert len(found) == count
    np.testing.assert_array_equal(found[-1].to_array(), pixels)


def test_more_than_16_bits_of_instances_are_over_the_limit(tmp_path):
    chunks = chunk(categories=[1] * 65_536, scores=[1] * 65_536)
    (tmp_path / "masks.png").write_bytes(png(4, 3, image_data=rows(NUMBERS), chunks=chunks))
    with pytest.raises(ldls.LimitError, match=r"masks\.png: masks: 65536 instances, expected at most 65535"):
        read(tmp_path / "masks.png")

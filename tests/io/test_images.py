"""Image files: PNG and JPEG whatever their names end in, and nothing else."""

import io
import struct
import subprocess
import zlib

import numpy as np
import pytest
from PIL import Image, ImageOps

import ldls
from ldls.io.images import SIGNATURES, png_of, read_image_size

RGB = np.arange(60 * 80 * 3).reshape(60, 80, 3).astype(np.uint8)
EPS = b"""%!PS-Adobe-3.0 EPSF-3.0
%%BoundingBox: 0 0 80 60
%%EndComments
0 0 moveto 80 60 lineto stroke
%%EOF
"""


def content(format, pixels=RGB, **options):
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format, **options)
    return file.getvalue()


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(width, height, *chunks):
    return b"".join([SIGNATURES["PNG"], chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)), *chunks])


@pytest.fixture
def write(tmp_path):
    """Writes image.png."""

    def write(content):
        path = tmp_path / "image.png"
        path.write_bytes(content)
        return path

    return write


@pytest.mark.parametrize(("format", "tolerance"), [("PNG", 0), ("JPEG", 60)])
def test_png_and_jpeg_are_read_whatever_their_names_end_in(write, format, tolerance):
    smooth = np.ascontiguousarray(np.broadcast_to(np.arange(0, 240, 4, np.uint8)[:, None, None], (60, 80, 3)))
    path = write(content(format, smooth))
    assert np.abs(ldls.read_image(path).astype(int) - smooth).max() <= tolerance
    assert read_image_size(path) == (60, 80)


@pytest.mark.parametrize("mode", ["1", "L", "P", "LA", "RGBA", "I;16"])
def test_grey_palettes_and_alpha_become_rgb(write, mode):
    file = io.BytesIO()
    source = Image.fromarray(RGB) if mode != "I;16" else Image.fromarray(RGB[:, :, 0].astype(np.uint16))
    source.convert(mode).save(file, "PNG")
    assert ldls.read_image(write(file.getvalue())).shape == (60, 80, 3)


GREY_16 = np.array([[0, 255, 256, 1000, 30000, 65535]], np.uint16)


def test_of_16_bits_the_upper_8_are_taken(write):
    upper = np.repeat((GREY_16 >> 8)[..., None], 3, axis=2)
    np.testing.assert_array_equal(ldls.read_image(write(content("PNG", GREY_16))), upper)
    rows = b"\0" + np.repeat(GREY_16[..., None], 3, axis=2).astype(">u2").tobytes()
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 6, 1, 16, 2, 0, 0, 0))
    colour = b"".join([SIGNATURES["PNG"], head, chunk(b"IDAT", zlib.compress(rows)), chunk(b"IEND", b"")])
    np.testing.assert_array_equal(ldls.read_image(write(colour)), upper)


@pytest.mark.parametrize("orientation", range(10))
def test_a_jpeg_is_turned_upright_by_its_exif(write, orientation):
    smooth = np.add.outer(np.arange(60), 2 * np.arange(80)).astype(np.uint8)
    picture = Image.fromarray(smooth)
    exif = picture.getexif()
    exif[0x112] = orientation
    path = write(content("JPEG", smooth, quality=100, exif=exif))
    with Image.open(path) as opened:
        expected = np.asarray(ImageOps.exif_transpose(opened).convert("RGB"))
    assert expected.shape == ((80, 60, 3) if 5 <= orientation <= 8 else (60, 80, 3))
    np.testing.assert_array_equal(ldls.read_image(path), expected)
    assert read_image_size(path) == expected.shape[:2]


@pytest.mark.parametrize(
    "exif",
    [
        pytest.param(b"Exif\0\0hello", id="no TIFF"),
        pytest.param(b"Exif\0\0MM\0*\0\0\0\x08\0\x09\x01", id="cut"),
        pytest.param(b"Exif\0\0MM\0*\0\0\0\x08\0\1\x01\x12\0\2\0\0\0\1a\0\0\0\0\0\0\0", id="a word"),
    ],
)
@pytest.mark.filterwarnings("ignore:Corrupt EXIF data")
def test_exif_that_is_broken_turns_nothing(write, exif):
    path = write(content("JPEG", exif=exif))
    assert ldls.read_image(path).shape == (60, 80, 3)
    assert read_image_size(path) == (60, 80)


@pytest.mark.parametrize("read", [ldls.read_image, read_image_size], ids=["pixels", "size"])
@pytest.mark.parametrize(
    "other",
    [
        pytest.param(EPS, id="EPS, which starts Ghostscript"),
        pytest.param(b"%PDF-1.4\n", id="PDF"),
        pytest.param(content("GIF"), id="GIF"),
        pytest.param(content("TIFF"), id="TIFF"),
        pytest.param(content("BMP"), id="BMP"),
        pytest.param(content("WEBP"), id="WebP"),
        pytest.param(b"P6 80 60 255\n" + RGB.tobytes(), id="PPM"),
        pytest.param(b"nothing", id="text"),
    ],
)
def test_other_formats_named_png_are_refused_and_start_no_program(write, monkeypatch, read, other):
    def start(*arguments, **options):
        raise AssertionError("a program was started")

    monkeypatch.setattr(subprocess.Popen, "__init__", start)
    with pytest.raises(
        ldls.UnsupportedFormatError, match=r"image\.png: not a whole image: begins with .*, expected a JPEG or PNG"
    ):
        read(write(other))


WHOLE = content("PNG")


@pytest.mark.parametrize(
    "broken",
    [
        pytest.param(b"", id="empty"),
        pytest.param(png(80, 60, chunk(b"IEND", b"")), id="no IDAT"),
        pytest.param(png(80, 60), id="nothing after the head"),
        pytest.param(SIGNATURES["PNG"], id="signature alone"),
        pytest.param(WHOLE[: len(WHOLE) // 2], id="cut in half"),
        pytest.param(WHOLE[:40], id="cut in the head"),
        pytest.param(WHOLE.replace(b"IDAT", b"IDAX"), id="wrong sum"),
        pytest.param(png(80, 60, chunk(b"IDAT", b"no deflate")), id="no deflate"),
        pytest.param(content("JPEG")[:300], id="cut JPEG"),
        pytest.param(SIGNATURES["JPEG"], id="first bytes of a JPEG"),
    ],
)
def test_what_is_not_whole_is_corrupt(write, broken):
    with pytest.raises(ldls.CorruptFileError, match=r"image\.png: not a whole image"):
        ldls.read_image(write(broken))


def test_a_png_bomb_is_refused_by_its_pixels(write):
    bomb = png(20_000, 20_000, chunk(b"IDAT", zlib.compress(bytes(1 << 20))))
    with pytest.raises(ldls.LimitError, match=r"image\.png: .*400000000 pixels"):
        ldls.read_image(write(bomb))


def test_pixels_that_cannot_come_of_the_bytes_take_no_memory(write):
    lying = png(9_000, 9_000, chunk(b"IDAT", zlib.compress(bytes(1000))))
    with pytest.raises(ldls.TruncatedFileError, match=r"image\.png: 9000 x 9000 pixels cannot come of \d+ bytes"):
        ldls.read_image(write(lying))


def test_an_image_of_one_colour_packs_well_and_is_read(write):
    path = write(content("PNG", np.zeros((2000, 2000, 3), np.uint8)))
    assert path.stat().st_size * 900 < 2000 * 2000 * 3
    assert ldls.read_image(path).shape == (2000, 2000, 3)


def test_a_jpeg_of_more_pixels_than_its_bytes_can_hold_takes_no_memory(tmp_path):
    path = tmp_path / "image.jpg"
    Image.new("RGB", (80, 60), (9, 80, 200)).save(path)
    content = path.read_bytes()
    at = content.index(b"\xff\xc0") + 5  # height and width of a baseline image
    path.write_bytes(content[:at] + b"\x20\x00\x20\x00" + content[at + 4 :])
    with pytest.raises(ldls.TruncatedFileError, match=r"image\.jpg: 8192 x 8192 pixels cannot come of \d+ bytes"):
        ldls.read_image(path)
    path.write_bytes(content)
    assert ldls.read_image(path).shape == (60, 80, 3)
    Image.new("L", (4000, 3000)).save(path, quality=1, optimize=True, progressive=True)  # packed as well as may be
    assert ldls.read_image(path).shape == (3000, 4000, 3)


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA"])
def test_a_picture_is_the_same_in_its_file(mode):
    bands = Image.new(mode, (1, 1)).getbands()
    pixels = np.random.default_rng(0).integers(0, 256, (23, 31, len(bands)), np.uint8)
    picture = Image.fromarray(pixels.squeeze())
    with Image.open(io.BytesIO(png_of(picture))) as found:
        assert (found.format, found.mode) == ("PNG", mode)
        np.testing.assert_array_equal(np.asarray(found), np.asarray(picture))


def test_a_picture_of_a_palette_keeps_its_colours():
    picture = Image.fromarray(RGB).quantize(16)
    with Image.open(io.BytesIO(png_of(picture))) as found:
        np.testing.assert_array_equal(np.asarray(found.convert("RGB")), np.asarray(picture.convert("RGB")))

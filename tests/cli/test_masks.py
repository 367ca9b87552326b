import json

import numpy as np
import pytest
from PIL import Image

import ldls
from command import command


@pytest.fixture
def masks(tmp_path):
    pixels = np.zeros((3, 40, 60), bool)
    pixels[0, 2:22, 3:33] = True
    pixels[1, 10:38, 20:50] = True
    pixels[2, 0:3, 50:53] = True
    made = ldls.InstanceMasks.from_array(pixels, categories=[3, 1, 18], scores=[0.9, 0.5, 0.75])
    ldls.save(made, tmp_path / "masks.json")
    return made, tmp_path


def test_masks_go_through_every_format_and_stay_what_they_are(masks):
    made, folder = masks
    resolved = made.resolve_overlaps()
    ldls.save(resolved, folder / "start.json")
    stops = ["a.png", "b.npz", "c.json", "d.npz"]
    before = "start.json"
    for stop in stops:
        outcome = command("masks", "convert", folder / before, folder / stop)
        assert outcome.exit_code == 0, outcome.output
        assert f"wrote 3 of 3 masks to {folder / stop}" in outcome.output
        before = stop
    found = ldls.read_masks(folder / before)
    np.testing.assert_array_equal(found.to_array(), resolved.to_array())
    assert found.categories.tolist() == made.categories.tolist()
    assert found.scores.tolist() == made.scores.tolist()
    assert [mask.name for mask in found] == ["car", "person", "dog"]


@pytest.mark.parametrize(
    ("options", "change"),
    [
        pytest.param(["--min-score", 0.6], lambda m: m.filter(min_score=0.6), id="score"),
        pytest.param(["--categories", "car, 18"], lambda m: m.filter(categories=[3, 18]), id="name and id"),
        pytest.param(["--min-area", 100], lambda m: m.filter(min_area=100), id="area"),
        pytest.param(["--resolve", "area"], lambda m: m.resolve_overlaps("area"), id="overlaps"),
        pytest.param(["--shrink", 2, "--grow", 1], lambda m: m.shrink(2).grow(1), id="opening"),
        pytest.param(["--shrink", 2, "--min-area", 1], lambda m: m.filter(min_area=10).shrink(2), id="area shrunk"),
        pytest.param(["--grow", 2, "--min-area", 10], lambda m: m.grow(2), id="area grown"),
    ],
)
def test_masks_change_on_the_way(masks, options, change):
    made, folder = masks
    outcome = command("masks", "convert", folder / "masks.json", folder / "out.npz", *options)
    assert outcome.exit_code == 0, outcome.output
    expected, found = change(made), ldls.read_masks(folder / "out.npz")
    np.testing.assert_array_equal(found.to_array(), expected.to_array())
    assert found.categories.tolist() == expected.categories.tolist()


def test_of_overlapping_masks_what_is_left_of_one_may_be_too_small(tmp_path):
    pixels = np.zeros((3, 40, 60), bool)
    pixels[0, 0:2, 0:2] = True
    pixels[1, 0:10, 0:10] = True
    pixels[2, 0:10, 0:12] = True
    ldls.save(ldls.InstanceMasks.from_array(pixels), tmp_path / "masks.json")
    words = ["convert", tmp_path / "masks.json", tmp_path / "out.npz", "--resolve", "order", "--min-area", 50]
    outcome = command("masks", *words)
    assert outcome.exit_code == 0, outcome.output
    # the mask of four pixels leaves them to the next
    np.testing.assert_array_equal(ldls.read_masks(tmp_path / "out.npz").to_array(), pixels[1:2])


def test_a_folder_of_one_png_an_instance_is_taken(masks):
    made, folder = masks
    (folder / "each").mkdir()
    for number, pixels in enumerate(made.to_array()):
        Image.fromarray(pixels).save(folder / f"each/{number}.png")
    outcome = command("masks", "show", folder / "each")
    assert outcome.exit_code == 0 and "3 masks of 40 x 60 pixels (height x width)" in outcome.output, outcome.output
    outcome = command("masks", "convert", folder / "each", folder / "out.npz")
    assert outcome.exit_code == 0, outcome.output
    np.testing.assert_array_equal(ldls.read_masks(folder / "out.npz").to_array(), made.to_array())


def test_variants_are_written(masks):
    made, folder = masks
    for name, variant in {"list.json": "results", "research.npz": "research", "stack.npy": "pixels"}.items():
        outcome = command("masks", "convert", folder / "masks.json", folder / name, "--variant", variant)
        assert outcome.exit_code == 0, outcome.output
    assert isinstance(json.loads((folder / "list.json").read_text()), list)
    with np.load(folder / "research.npz") as arrays:
        assert arrays["masks"].shape == (40, 60, 3)
    stack = np.load(folder / "stack.npy")
    np.save(folder / "last.npy", np.moveaxis(stack, 0, -1))
    outcome = command("masks", "convert", folder / "last.npy", folder / "back.npz", "--instance-axis", "last")
    assert outcome.exit_code == 0, outcome.output
    np.testing.assert_array_equal(ldls.read_masks(folder / "back.npz").to_array(), made.to_array())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        pytest.param(["out.png"], "--resolve score leaves it to one", id="overlaps in a PNG"),
        pytest.param(["out.npy"], "pixels", id="categories would be lost"),
        pytest.param(["out.tiff"], "cannot write '.tiff'", id="suffix"),
        pytest.param(["out.json", "--categories", "carr"], "did you mean 'car'", id="category"),
        pytest.param(["out.json", "--image-size", "12"], "expected HEIGHTxWIDTH", id="size"),
        pytest.param(["out.json", "--image-size", "60x40"], "swapped", id="swapped"),
        pytest.param(["out.json", "--min-score", "2"], "--min-score: got 2.0", id="score"),
    ],
)
def test_faults_are_said_in_a_line_and_nothing_is_written(masks, words, message):
    _, folder = masks
    outcome = command("masks", "convert", folder / "masks.json", folder / words[0], *words[1:])
    assert outcome.exit_code == 1
    assert message in outcome.stderr
    assert not (folder / words[0]).exists()


def test_show_prints_a_line_a_mask_and_draws_them(masks):
    _, folder = masks
    Image.new("RGB", (60, 40), (90, 120, 90)).save(folder / "image.png")
    outcome = command(
        "masks", "show", folder / "masks.json", "--image", folder / "image.png", "--picture", folder / "picture.png"
    )
    assert outcome.exit_code == 0, outcome.output
    assert "3 masks of 40 x 60 pixels (height x width)" in outcome.output
    (car,) = (line for line in outcome.output.splitlines() if "car" in line)
    assert [cell.strip() for cell in car.strip("│").split("│")] == ["1", "car", "3", "0.90", "600", "2, 3", "20 x 30"]
    with Image.open(folder / "picture.png") as picture:
        assert picture.width >= 1800


def test_make_saves_what_a_segmenter_finds(tmp_path):
    Image.new("RGB", (60, 40)).save(tmp_path / "image.png")
    label = "Car 0.00 0 -1.5 5 6 20 30 1.5 1.6 3.9 1.0 1.7 20.0 -1.6 0.75\n"
    (tmp_path / "label.txt").write_text(label + label.replace("Car", "Pedestrian").replace("0.75", "0.25"))
    segmenter = f"boxes:{tmp_path / 'label.txt'}"
    outcome = command("masks", "make", tmp_path / "image.png", tmp_path / "masks.npz", "--segmenter", segmenter)
    assert outcome.exit_code == 0, outcome.output
    found = ldls.read_masks(tmp_path / "masks.npz")
    assert [mask.name for mask in found] == ["car", "person"]
    assert found[0].bounding_box == (6, 5, 25, 16)
    wanted = ["--min-score", "0.5", "--categories", "car,person"]
    command("masks", "make", tmp_path / "image.png", tmp_path / "some.npz", "--segmenter", segmenter, *wanted)
    assert [mask.name for mask in ldls.read_masks(tmp_path / "some.npz")] == ["car"]


@pytest.mark.parametrize("count", [0, 300])
def test_any_number_of_masks(count, tmp_path):
    pixels = np.zeros((count, 40, 60), bool)
    pixels.reshape(count, 2400)[np.arange(count), 7 * np.arange(count)] = True
    ldls.save(ldls.InstanceMasks.from_array(pixels), tmp_path / "masks.json")
    assert command("masks", "convert", tmp_path / "masks.json", tmp_path / "masks.png").exit_code == 0
    np.testing.assert_array_equal(ldls.read_masks(tmp_path / "masks.png").to_array(), pixels)


@pytest.mark.parametrize("ids", [pytest.param(("a", "b"), id="text"), pytest.param((7, 8), id="numbers")])
def test_an_image_is_chosen_by_its_id(masks, ids):
    made, folder = masks
    content = made.to_coco()
    images = [content["images"][0] | {"id": each} for each in ids]
    annotations = [each | {"image_id": ids[0]} for each in content["annotations"]]
    (folder / "two.json").write_text(json.dumps(content | {"images": images, "annotations": annotations}))
    for chosen, n_masks in zip(ids, (3, 0), strict=True):
        outcome = command("masks", "show", folder / "two.json", "--image-id", str(chosen))
        assert outcome.exit_code == 0 and f"{n_masks} masks of" in outcome.output, outcome.output

"""Overlays put colours and names where they belong."""

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import ldls
from ldls.palette import BACKGROUND, instance_colours
from ldls.viewing import birds_eye_view, comparison, masks_overlay, overlay
from ldls.viewing.drawing import MARK
from ldls.viewing.overlay import overlays_of, pixel_of
from ldls.viewing.shown import Shown, images_of, names_of
from ldls.viewing.tags import place_tags, shortened


@pytest.fixture
def result(small_scene):
    points, masks, camera = small_scene
    points = np.vstack([points, [[0, 0, -5], [np.nan, 0, 0]]]).astype(np.float32)
    return ldls.segment(points, masks, camera)


def photo(height: int = 60, width: int = 80) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 255, (height, width, 3), dtype=np.uint8)


def pixels_at(picture, result, view: int = 0) -> np.ndarray:
    """(n, 3) colours of the picture at the points of a view."""
    seen = result.views[view]
    scale = picture.width / seen.view.masks.width
    x, y = np.floor((seen.pixels + 0.5) * scale).astype(int).T
    return np.asarray(picture)[y, x]


@pytest.mark.parametrize("stage", ["direct", "diffused", "final"])
def test_points_have_their_instances_colours(result, stage) -> None:
    picture = overlay(result, photo(), stage=stage)
    labels = {"direct": result.direct_labels, "diffused": result.diffused_labels, "final": result.labels}[stage]
    labels = labels[result.in_view]
    # the nearest point at a place is on top: look at points that no other one is drawn near to
    at = result.pixels
    apart = np.linalg.norm(at[:, None] - at[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    alone = (apart.min(axis=1) > 0.3) & (labels > 0)
    assert alone.sum() > 20
    expected = instance_colours([1, 3])[labels[alone] - 1].astype(int)
    shown_colours = pixels_at(picture, result)[alone].astype(int)
    # a few lie beneath a name
    assert (np.abs(shown_colours - expected).max(axis=1) <= 2).mean() > 0.9


@pytest.mark.parametrize(
    ("size", "width_px"),
    [
        pytest.param((60, 80), None, id="enlarged"),
        pytest.param((60, 80), 97, id="to an odd width"),
        pytest.param((1200, 3840), None, id="reduced"),
    ],
)
def test_pictures_have_the_width_asked_for(small_scene, size, width_px) -> None:
    points, _, camera = small_scene
    masks = ldls.InstanceMasks.from_boxes([[1, 1, 9, 9]], size, categories=[3])
    picture = overlay(ldls.segment(points, masks, camera), photo(*size), width_px=width_px)
    assert picture.width == (width_px or 1800)
    assert picture.height == round(size[0] * picture.width / size[1])


def test_pictures_of_high_images_are_narrower(small_scene) -> None:
    points, _, camera = small_scene
    masks = ldls.InstanceMasks.from_boxes([[1, 1, 9, 9]], (400, 16), categories=[3])
    result = ldls.segment(points, masks, camera)
    assert overlay(result).size == (144, 3600)
    assert comparison(result).height < 5000
    ring = ldls.segment(points, [ldls.View(masks, camera, name) for name in "ab"])
    assert overlay(ring).height < 4000
    assert pixel_of(ring, overlay(ring).size[::-1], (10, 100))[0] == 0


def test_background_points_leave_the_image_visible(small_scene) -> None:
    points, masks, camera = small_scene
    nothing = masks.select([])
    with_points = overlay(ldls.segment(points, nothing, camera), photo())
    without = overlay(ldls.segment(points[:0], nothing, camera), photo())
    change = np.abs(np.asarray(with_points, float) - np.asarray(without, float)).mean()
    assert 0 < change < 10


def test_marked_points_have_a_white_rim(result) -> None:
    marked = result.labels == 1
    (image,) = images_of(result, None)
    shown = [Shown.of(result, "final", chosen) for chosen in (None, marked)]
    plain, rimmed = overlays_of(shown, result.views[0], image, 1800)
    changed = np.any(np.asarray(plain) != np.asarray(rimmed), axis=2)
    white = np.all(np.asarray(rimmed) == MARK, axis=2)
    assert (white & changed).sum() > 100
    # the other object is as it was
    assert not changed[:, 1000:].any()


def test_a_ring_has_a_picture_a_camera_with_its_name(small_scene) -> None:
    points, masks, camera = small_scene
    views = [ldls.View(masks, camera, name) for name in ("left", "right", "rear")]
    result = ldls.segment(points, views)
    picture = overlay(result, [photo(), None, photo()], width_px=400)
    assert picture.size == (2 * 400 + 6, 2 * (300 + 30))
    assert overlay(result).width == 1800


def test_cameras_without_names_are_numbered(small_scene) -> None:
    points, masks, camera = small_scene
    for picture in (overlay, comparison):
        unnamed, numbered = (
            np.asarray(picture(ldls.segment(points, [ldls.View(masks, camera, name) for name in names])))
            for names in (("", ""), ("camera 0", "camera 1"))
        )
        np.testing.assert_array_equal(unnamed, numbered)


@pytest.mark.parametrize(
    ("images", "message"),
    [
        pytest.param([photo(), photo()], "images: got 2, expected 1", id="more images than cameras"),
        pytest.param(
            photo(80, 60), r"image: got 80 x 60 \(height x width\), the masks are of 60 x 80$", id="swapped sides"
        ),
        pytest.param(photo().astype(float), "float64; read it with ldls.read_image", id="not uint8"),
        pytest.param(photo()[..., 0], r"image: expected \(60, 80, 3\) uint8, .*got \(60, 80\) uint8", id="grey"),
        pytest.param(Image.fromarray(photo()).convert("L"), r"got \(60, 80\) uint8; read it", id="grey of Pillow"),
        pytest.param("a.png", "got 'a.png'; read it with ldls.read_image", id="name of a file"),
        pytest.param(Path("a.png"), r"got \w*Path\('a.png'\); read it with ldls.read_image", id="path"),
        pytest.param(["a.png"], "got 'a.png'; read it with ldls.read_image", id="name of a file in a list"),
        pytest.param(3, "got 3; read it with ldls.read_image", id="a number"),
    ],
)
def test_images_that_do_not_fit_are_refused(result, images, message) -> None:
    with pytest.raises(ldls.InputError, match=message):
        overlay(result, images)


def test_images_of_pillow_are_taken(result) -> None:
    for draw in (overlay, comparison, lambda _, image: masks_overlay(result.views[0].view.masks, image)):
        expected = draw(result, photo()).tobytes()
        assert draw(result, Image.fromarray(photo())).tobytes() == expected
    assert overlay(result, [Image.fromarray(photo())]).tobytes() == overlay(result, photo()).tobytes()


@pytest.mark.parametrize("draw", [overlay, comparison])
def test_without_a_view_there_is_no_image_to_draw_on(small_scene, draw) -> None:
    with pytest.raises(ldls.InputError, match="result: has no views, .*birds_eye_view draws its points"):
        draw(ldls.segment(small_scene[0], []))


def test_a_picture_without_width_is_refused(result) -> None:
    with pytest.raises(ldls.ParameterError, match="width_px: got 0, expected 1 or more"):
        overlay(result, width_px=0)


def test_an_unknown_stage_is_refused(result) -> None:
    with pytest.raises(ldls.ParameterError, match="stage: got 'diffuse', expected one of direct, diffused, final"):
        overlay(result, stage="diffuse")


def test_masks_alone_are_drawn_in_the_same_colours(small_scene) -> None:
    _, masks, _ = small_scene
    picture = np.asarray(masks_overlay(masks, photo())).astype(int)
    middle = picture[30 * 1800 // 80, 23 * 1800 // 80]
    colour = instance_colours([1])[0].astype(int)
    grey = np.asarray(masks_overlay(masks.select([]), photo())).astype(int)[30 * 1800 // 80, 23 * 1800 // 80]
    np.testing.assert_allclose(middle, 0.72 * grey + 0.28 * colour, atol=2)


@pytest.mark.parametrize("width", [640, 1920, 3840])
def test_masks_are_outlined_and_their_boxes_are_not_filled(width) -> None:
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, width), np.linspace(-1.5, 1.5, width // 4))
    image = np.full((*x.shape, 3), 90, np.uint8)
    ellipse = ldls.InstanceMasks.from_array([x**2 + y**2 < 1], categories=[3])
    drawn, empty = (np.asarray(masks_overlay(each, image)).astype(int) for each in (ellipse, ellipse.select([])))
    changed = np.abs(drawn - empty).max(axis=2)
    from_middle = np.hypot(*np.meshgrid(*(np.linspace(-1.5, 1.5, n) for n in changed.shape[::-1])))
    assert not changed[(from_middle > 1.05) & (np.arange(len(changed)) > 150)[:, None]].any()
    inside = np.median(changed[from_middle < 0.9])
    on_edge = changed[len(changed) // 2, np.abs(from_middle[len(changed) // 2] - 1) < 0.01]
    assert on_edge.max() > 3 * inside > 0


@pytest.fixture
def drawn(monkeypatch):
    """The tags that pictures have."""
    tags = []
    # the package has a function of the module's name
    module = importlib.import_module("ldls.viewing.overlay")
    monkeypatch.setattr(module, "draw_tags", lambda picture, of_picture, *_: tags.extend(of_picture))
    return tags


@pytest.mark.parametrize("width", [1920, 3840])
def test_masks_thinner_than_the_line_are_seen(width, drawn) -> None:
    mask = np.zeros((width // 4, width), bool)
    mask[width // 8 :, width // 2 :][:2, :2] = True
    small = ldls.InstanceMasks.from_array([mask], categories=[3])
    image = np.full((*mask.shape, 3), 90, np.uint8)
    shown, empty = (np.asarray(masks_overlay(each, image)).astype(int) for each in (small, small.select([])))
    middle = [slice(size // 2 - 1, size // 2 + 3) for size in shown.shape[:2]]
    assert np.abs(shown - empty)[*middle].max() > 60


def test_only_objects_with_points_are_named(small_scene, drawn) -> None:
    points, masks, camera = small_scene
    nowhere = np.zeros((60, 80), bool)
    nowhere[:6, :6] = True
    masks = ldls.InstanceMasks.from_array([nowhere, *masks.to_array()], categories=[18, 1, 3])
    overlay(ldls.segment(points, masks, camera))
    assert [tag.text for tag in drawn] == ["person 2", "car 3"]


def test_masks_alone_are_named_by_label_too(small_scene, drawn) -> None:
    masks_overlay(small_scene[1])
    assert [tag.text for tag in drawn] == ["person 1", "car 2"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        pytest.param("car 3", "car 3", id="short"),
        pytest.param("vehicle.construction 12", "vehicle.construction 12", id="twenty"),
        pytest.param("a forklift that carries pallets 12", "a forklift that car\u2026 12", id="with its number"),
        pytest.param("a forklift that is of no number", "a forklift that is\u2026", id="without a number"),
        pytest.param(f"{'W' * 80} 3", f"{'W' * 19}\u2026 3", id="one word"),
        pytest.param("W" * 80, f"{'W' * 19}\u2026", id="one word without a number"),
        pytest.param("", "", id="none"),
    ],
)
def test_long_names_are_shortened_and_numbers_stay(text, expected) -> None:
    assert shortened(text) == expected


def test_long_names_are_drawn_as_shortened_ones(small_scene) -> None:
    points, masks, camera = small_scene

    def pictures(name):
        named = ldls.InstanceMasks.from_array(masks.to_array(), categories=[1, 1], names={1: name})
        result = ldls.segment(points, named, camera)
        return [picture.tobytes() for picture in (overlay(result), birds_eye_view(result), masks_overlay(named))]

    assert pictures("forklift" * 10) == pictures("forklift" * 2 + "for\u2026") != pictures("forklift" * 2 + "for")


def test_names_with_line_breaks_are_drawn_on_one_line(small_scene) -> None:
    points, masks, camera = small_scene

    def pictures(name):
        named = ldls.InstanceMasks.from_array(masks.to_array(), categories=[1, 1], names={1: name})
        views = [ldls.View(named, camera, f"{name} {side}") for side in ("left", "right")]
        result = ldls.segment(points, views)
        drawn = (overlay(result), birds_eye_view(result), comparison(result), masks_overlay(named))
        return [picture.tobytes() for picture in drawn]

    assert pictures("big\n\ttruck") == pictures("big truck") != pictures("truck")


def test_objects_that_an_image_overlooks_are_named_at_their_points(small_scene, drawn) -> None:
    points, masks, camera = small_scene
    result = ldls.segment(points, masks, camera)
    (seen,) = result.views
    car_alone = replace(seen, view=ldls.View(masks.select([1]), camera), labels=seen.labels[1:])
    overlay(replace(result, views=(car_alone,)))
    car, person = drawn
    assert [tag.text for tag in drawn] == ["car 2", "person 1"]
    assert [tag.colour for tag in (person, car)] == Shown.of(result, "final").colours
    at_px = seen.pixels[result.labels[seen.in_view] == 1]
    box = 1800 / 80 * (np.concatenate([at_px.min(axis=0), at_px.max(axis=0)]) + 0.5)
    np.testing.assert_allclose(person.box, box, atol=0.5)


def test_masks_without_pixels_are_no_trouble(small_scene) -> None:
    points, _, camera = small_scene
    empty = ldls.InstanceMasks.from_array(np.zeros((2, 60, 80), bool), categories=[1, 3])
    overlay(ldls.segment(points, empty, camera))


def test_the_background_has_no_colour() -> None:
    assert len(set(BACKGROUND)) == 1


@pytest.mark.parametrize(
    "boxes",
    [
        pytest.param([(50, 30, 90, 80)] * 6, id="all in one place"),
        pytest.param([(0, 0, 20, 90), (380, 0, 400, 90), (190, 0, 210, 9)], id="at the edges"),
    ],
)
def test_tags_stay_apart_and_inside(boxes: list[tuple[int, int, int, int]]) -> None:
    taken = [(100, 20, 140, 40)]
    places = place_tags(boxes, [(80, 16)] * len(boxes), np.zeros((100, 200), bool), (400, 200), taken=taken)
    canvas = np.zeros((200, 400), int)
    for place in [*taken, *places]:
        assert place is not None
        left, top, right, bottom = place
        assert left >= 0 and top >= 0 and right <= 400 and bottom <= 200
        canvas[top:bottom, left:right] += 1
    assert canvas.max() == 1


def test_a_tag_gives_way_to_what_is_drawn() -> None:
    covered = np.zeros((100, 200), bool)
    covered[40:60] = True
    (place,) = place_tags([(90, 60, 110, 90)], [(40, 10)], covered, (200, 100))
    assert place is not None
    left, top, right, bottom = place
    assert not covered[top:bottom, left:right].any()


def test_a_tag_without_room_is_left_out() -> None:
    assert place_tags([(0, 0, 9, 9)], [(80, 16)], np.zeros((20, 40), bool), (40, 20)) == [None]


def test_tracked_objects_look_the_same_in_every_sweep(two_sweeps):
    for picture_of in (overlay, birds_eye_view):
        one, other = (np.asarray(picture_of(each)) for each in two_sweeps)
        np.testing.assert_array_equal(one, other)
    one, other = (sorted(zip(names_of(each), Shown.of(each, "final").colours, strict=True)) for each in two_sweeps)
    assert one == other and [name for name, _ in one] == ["car 300", "person 31"]
    tables = [each._repr_html_().rpartition("<table>")[2] for each in two_sweeps]
    assert tables[0] == tables[1] and "<td>300</td><td>car</td>" in tables[0]


def test_what_has_no_points_has_no_number_where_others_are_tracked(two_sweeps):
    sweep = two_sweeps[0]
    unseen = replace(sweep, instances=(replace(sweep.instances[0], track=0), sweep.instances[1]))
    assert names_of(unseen) == ["person", "car 300"]

import json
import sys

import numpy as np
import pytest
from PIL import Image

import ldls
from command import command
from ldls.cli.chosen_point import chosen_point
from ldls.simulation import sample_frame
from ldls.viewing import overlay, save_picture
from ring_samples import as_views, random_ring


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    """A result of one camera and its file; the last four points are out of view."""
    generator = np.random.default_rng(7)
    person = generator.uniform([-0.6, -0.6, 9.8], [0.6, 0.6, 10.2], (120, 3))
    # before the same mask, far from the person and few
    stray = generator.uniform([-0.1, -0.1, 3.0], [0.1, 0.1, 3.1], (14, 3))
    wall = generator.uniform([-5, -4, 14], [5, 4, 14.2], (260, 3))
    unseen = [[0, 0, -5], [90, 0, 3], [np.nan, 0, 4], [0, 0, 0]]
    points = np.vstack([person, stray, wall, unseen])
    pixels = np.zeros((1, 60, 80), bool)
    pixels[0, 23:38, 33:47] = True
    masks = ldls.InstanceMasks.from_array(pixels, categories=[1], scores=[0.9])
    camera = ldls.Camera(projection=[[100, 0, 40], [0, 100, 30], [0, 0, 1]])
    result = ldls.segment(points, masks, camera, params=ldls.Params.paper())
    path = tmp_path_factory.mktemp("explain") / "frame.npz"
    ldls.save(result, path)
    return result, path


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """A result of the best known parameters and its file, with the explanation of some of its points."""
    sample = sample_frame()
    (image,) = sample.images
    result = ldls.segment(sample.points, image.masks, image.camera)
    path = tmp_path_factory.mktemp("explain") / "street.npz"
    ldls.save(result, path)
    points = [
        *np.flatnonzero(result.labels < result.diffused_labels)[::15],
        *np.flatnonzero(result.direct_labels > result.labels)[::40],
        *np.flatnonzero((result.direct_labels == 0) & (result.labels > 0))[::20],
    ]
    return path, [ldls.explain(result, int(point)) for point in points]


@pytest.fixture(scope="module")
def ring(tmp_path_factory):
    points, views = random_ring(4)
    views = [ldls.View(view.masks, view.camera, name) for view, name in zip(as_views(views), "abc", strict=True)]
    result = ldls.segment(points, views, params=ldls.Params(neighbors=6, sigma=0.3))
    path = tmp_path_factory.mktemp("explain") / "ring.npz"
    ldls.save(result, path)
    return result, path


def first(condition):
    return int(np.flatnonzero(condition)[0])


def test_a_point_of_an_object(frame):
    result, path = frame
    point = first(result.labels == 1)
    outcome = command("explain", point, path)
    assert outcome.exit_code == 0, outcome.output
    verdict, place, course, *rest = outcome.output.splitlines()
    assert verdict == ldls.explain(result, point).verdict
    assert verdict.startswith(f"Point {point} is person (label 1): ")
    assert place.startswith("It lies at x ")
    assert course.endswith("After diffusion: person (label 1). After outlier removal: person (label 1).")
    text = "\n".join(rest)
    for heading in ("what the camera sees", "likelihood after diffusion", "edges", "components of person (label 1)"):
        assert heading in text
    assert "this point's, kept" in text
    assert text.count("│ point ") == result.params.neighbors
    assert max(len(line) for line in rest if not line.endswith(".")) <= 100


def test_a_point_that_outlier_removal_took_away(frame):
    result, path = frame
    point = first(result.labels < result.diffused_labels)
    outcome = command("explain", point, path)
    assert outcome.output.splitlines()[0] == (
        f"Point {point} is background: diffusion gave it to person (label 1), but it lies in a component of 14 points, "
        "the largest has 120: removed."
    )
    assert "this point's, removed" in outcome.output
    assert "background, person (label 1) after diffusion" in outcome.output


def test_a_point_near_the_ground_says_how_near(street):
    path, explanations = street
    found = next(each for each in explanations if each.cleared)
    verdict, place, course, *_ = command("explain", found.point, path).output.splitlines()
    assert verdict.startswith(f"Point {found.point} is background: it is ")
    assert verdict.endswith(" the ground, lower than 2 cm above it.")
    assert f"{abs(found.height_m):.2f} m {'above' if found.height_m >= 0 else 'below'} the ground." in place
    assert course.startswith("Direct projection: ")
    assert course.endswith(". Near the ground: background.")
    assert "After diffusion" not in course


def test_a_mask_that_does_not_count_says_how_far_its_object_is(street):
    path, explanations = street
    found = next(each for each in explanations if "outside the depth group" in each.verdict)
    verdict, *lines = command("explain", found.point, path).output.splitlines()
    offset = verdict.partition("it is ")[2].rstrip(".")
    name = offset.removeprefix("outside the depth group of ").rpartition(", ")[0]
    assert f"It is {offset}: pixels of {name} do not count." in lines
    assert any(f"{name}, not counted" in line for line in lines)
    assert any("label counts" in line or "not all labels count" in line for line in lines)


def test_background_beside_a_mask_does_not_count(street):
    path, explanations = street
    found = next(each for each in explanations if each.sights[0].beside and each.sights[0].window[0].label == 0)
    objects = " and of ".join(f"{found.names[label]} (label {label})" for label in found.sights[0].beside)
    output = command("explain", found.point, path).output
    assert f"It is beside the edge of {objects}, as far away: background pixels do not count." in output
    assert "background, not counted" in output


def test_parts_are_said_to_be_kept_and_others_why_not(street, tmp_path):
    path, _ = street
    # the truck behind a pole
    course, *lines = command("explain", 16999, path).output.splitlines()[2:]
    assert course.endswith("After outlier removal: truck (label 6), a part kept beside the largest.")
    assert any("0.92 m" in line and "this point's, kept" in line for line in lines)
    sample = sample_frame()
    (image,) = sample.images
    alone = ldls.segment(sample.points, image.masks, image.camera, params=ldls.Params(part_gap=0.9))
    ldls.save(alone, tmp_path / "alone.npz")
    verdict, *lines = command("explain", 16999, tmp_path / "alone.npz").output.splitlines()
    assert verdict.endswith("it lies in a component of 71 points, 0.92 m from the largest, which has 85: removed.")
    assert any("0.92 m" in line and "this point's, removed" in line for line in lines)


def test_edges_that_leave_the_ground_are_said_to_be_weakened(street):
    path, explanations = street
    found = next(each for each in explanations if any(near.leaves_ground for near in each.neighbors))
    assert ", weakened: leaves the ground" in command("explain", found.point, path).output


def test_a_background_point_has_no_components(frame):
    result, path = frame
    outcome = command("explain", first(result.diffused_labels == 0), path)
    assert " is background: " in outcome.output.splitlines()[0]
    assert "After diffusion: background.\n" in outcome.output
    assert "components" not in outcome.output


@pytest.mark.parametrize(
    ("back", "words"),
    [
        pytest.param(4, "behind the camera, at a depth of -5.00 m", id="behind"),
        pytest.param(3, "at u 3040.0, v 30.0, outside the image of 60 x 80 pixels (height x width)", id="outside"),
        pytest.param(2, "a coordinate is not finite", id="not finite"),
        pytest.param(1, "at (0, 0, 0), which stands for a missing return", id="origin"),
    ],
)
def test_points_out_of_view_are_told_why(frame, back, words):
    result, path = frame
    outcome = command("explain", len(result.points) - back, path)
    assert outcome.exit_code == 0, outcome.output
    assert "is out of view: " in outcome.output.splitlines()[0]
    assert words in outcome.output.splitlines()[0]
    assert "likelihood" not in outcome.output
    if back == 2:
        printed = json.loads(command("explain", len(result.points) - back, path, "--json").output)
        assert printed["xyz"] == [None, 0.0, 4.0]


def test_json_is_one_object_with_the_same(frame):
    result, path = frame
    point = first(result.labels == 1)
    printed = json.loads(command("explain", point, path, "--json").output)
    assert printed == json.loads(json.dumps(ldls.explain(result, point).to_dict()))


def test_files_without_a_result_give_the_same(frame_571, tmp_path):
    files = ["--points", frame_571.points_path, "--calib", frame_571.calib_path, "--masks", frame_571.masks_path]
    view = ldls.View(frame_571.masks, frame_571.camera, "image_2")
    result = ldls.segment(frame_571.points, [view])
    point = first(result.labels > result.direct_labels)
    outcome = command("explain", point, *files)
    assert outcome.exit_code == 0, outcome.output
    assert outcome.output.splitlines()[0] == ldls.explain(result, point).verdict
    ldls.save(result, tmp_path / "571.npz")
    assert outcome.output == command("explain", point, tmp_path / "571.npz").output
    other = command("explain", point, *files, "--camera", 3)
    assert other.exit_code == 0
    assert "image_3" in other.output and "image_3" not in outcome.output
    wrong = command("explain", point, *files, "--camera", 4)
    assert "camera: got 4, expected 0 to 3" in wrong.stderr


def test_a_place_takes_the_nearest_point_also_with_a_minus_sign(frame):
    result, path = frame
    x, y, z = result.points[300]
    word = f"{-abs(x):.3f},{y:.3f},{z:.3f}"
    distances = np.linalg.norm(result.points - [-abs(x), y, z], axis=1)
    nearest = int(np.nanargmin(distances))
    outcome = command("explain", word, path)
    assert outcome.exit_code == 0, outcome.output
    assert outcome.output.startswith(f"Point {nearest} is ")
    assert f"Point {nearest} is the one nearest to " in outcome.output.splitlines()[1]
    assert f": {distances[nearest]:.2f} m away." in outcome.output.splitlines()[1]


def test_a_pixel_takes_the_nearest_point_in_view(frame):
    result, path = frame
    outcome = command("explain", "40,30", path)
    distances = np.linalg.norm(result.pixels - [40, 30], axis=1)
    row = int(result.in_view[distances.argmin()])
    expected = f"Point {row} is the one in view nearest to pixel 40,30: {distances.min():.1f} pixels away."
    assert outcome.output.splitlines()[1] == expected


def test_of_points_on_one_pixel_the_nearest_to_the_sensor_is_taken():
    masks = ldls.InstanceMasks.from_array(np.ones((1, 40, 60), bool))
    camera = ldls.Camera(projection=[[40, 0, 30], [0, 40, 20], [0, 0, 1]])
    result = ldls.segment(np.array([[0, 0, 9.0], [0, 0, 5.0], [1, 0, 2.0]]), masks, camera)
    assert chosen_point("30,20", result).row == 1


@pytest.mark.parametrize("camera", ["c", "2"], ids=["by name", "by number"])
def test_a_pixel_of_a_ring_belongs_to_a_camera(ring, camera):
    result, path = ring
    seen = result.views[2]
    row = int(seen.in_view[7])
    u, v = seen.pixels[7]
    outcome = command("explain", f"{u:.4f},{v:.4f}", path, "--camera", camera)
    assert outcome.exit_code == 0, outcome.output
    assert outcome.output.startswith(f"Point {row} is ")
    assert "what the cameras see" in outcome.output


def test_a_point_that_two_cameras_see_has_the_windows_of_both(ring):
    result, path = ring
    both = np.intersect1d(result.views[0].in_view, result.views[1].in_view)
    outcome = command("explain", int(both[3]), path)
    course = outcome.output.splitlines()[2]
    assert " by a, " in course
    assert " by b. After diffusion: " in course


@pytest.mark.parametrize(
    ("words", "message"),
    [
        pytest.param(["398"], "point: got 398, expected 0 to 397", id="beyond the last row"),
        pytest.param(["-1"], "point: got -1, expected 0 to 397", id="negative row"),
        pytest.param(["twelve"], "POINT: got 'twelve', expected a row number as 12345", id="no number"),
        pytest.param(["1.5"], "POINT: got '1.5', expected a row number", id="half a row"),
        pytest.param(["1,2,3,4"], "POINT: got '1,2,3,4', expected", id="four numbers"),
        pytest.param(["1,nan"], "POINT: got '1,nan', expected", id="NaN"),
        pytest.param(["1,"], "POINT: got '1,', expected", id="half a pixel"),
        pytest.param(["1,2", "--camera", "b"], "--camera: got 'b', expected one of 0 (camera 0)", id="no such camera"),
        pytest.param(["1", "--camera", "b"], "--camera: got 'b', expected one of 0 (camera 0)", id="beside a row"),
        pytest.param(["0,0,9", "--camera", "b"], "got 'b', expected one of 0 (camera 0)", id="beside a place"),
        pytest.param(["1", "--columns", "5"], "--columns: given beside RESULT", id="columns beside a result"),
        pytest.param(["1", "--image-id", "3"], "--image-id: given beside RESULT", id="files beside a result"),
        pytest.param(["1", "--no-fisheye"], "--fisheye: given beside RESULT", id="a lens beside a result"),
    ],
)
def test_misuse_is_one_line(frame, words, message):
    outcome = command("explain", words[0], frame[1], *words[1:])
    assert outcome.exit_code == 1
    assert outcome.stderr.startswith("error: ")
    assert message in outcome.stderr
    assert outcome.stdout == ""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        pytest.param(["3,4"], "--camera: missing, and a pixel of which picture? Expected one of 0 (a)", id="none"),
        pytest.param(["3,4", "--camera", "3"], "got '3', expected one of 0 (a), 1 (b), 2 (c)", id="no such one"),
        pytest.param(["3", "--camera", "a"], "only a pixel U,V belongs to a camera", id="beside a row"),
    ],
)
def test_misuse_of_rings_is_one_line(ring, words, message):
    outcome = command("explain", words[0], ring[1], *words[1:])
    assert outcome.exit_code == 1
    assert message in outcome.stderr


def test_files_of_another_kind_and_missing_ones_are_named(frame, tmp_path):
    masks = tmp_path / "masks.npz"
    ldls.save(frame[0].masks, masks)
    outcome = command("explain", 3, masks)
    assert outcome.exit_code == 1
    assert "masks.npz: " in outcome.stderr
    assert "expected those of ldls.save" in outcome.stderr
    missing = command("explain", "3", tmp_path / "none.npz", COLUMNS="500")  # breaks no long path
    assert missing.exit_code == 2 and "none.npz" in missing.stderr
    assert "RESULT: missing; give an .npz file" in command("explain", 3).stderr
    assert "RESULT: missing; give an .npz file" in command("explain", 3, "--masks", masks).stderr


def test_an_unknown_option_is_named_and_no_point(frame):
    outcome = command("explain", "--jsn", 3, frame[1])
    assert outcome.exit_code == 2
    assert "no such option: --jsn" in outcome.stderr


@pytest.mark.filterwarnings("ignore::ldls.errors.NothingInView")
def test_nothing_near_is_said_so():
    masks = ldls.InstanceMasks.from_array(np.ones((1, 40, 60), bool))
    camera = ldls.Camera(projection=[[40, 0, 30], [0, 40, 20], [0, 0, 1]])
    behind = ldls.segment(np.array([[0, 0, -9.0]]), masks, camera)
    with pytest.raises(ldls.InputError, match="no point is in view"):
        chosen_point("3,4", behind)
    with pytest.raises(ldls.InputError, match="there is no camera"):
        chosen_point("3,4", ldls.segment(np.array([[0, 0, 9.0]]), []))
    with pytest.warns(UserWarning, match="no row is finite"):
        lost = ldls.segment(np.array([[0, 0, np.nan]]), masks, camera)
    with pytest.raises(ldls.InputError, match="no point of the cloud is finite"):
        chosen_point("3,4,5", lost)


def test_the_extra_is_named_where_it_is_missing(frame, monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy.sparse", None)
    outcome = command("explain", first(frame[0].labels == 1), frame[1])
    assert outcome.exit_code == 1
    assert "pip install 'ldls[eval]'" in outcome.stderr


def test_help_teaches():
    text = command("explain", "--help").output
    assert "ldls explain 12345 results/000571.npz" in text
    assert "The first line is the verdict." in text


@pytest.mark.parametrize("rings", [False, True], ids=["one camera", "three cameras"])
def test_a_pixel_of_a_picture_of_ldls(frame, ring, tmp_path, rings):
    result, path = ring if rings else frame
    picture = overlay(result)
    save_picture(tmp_path / "a.png", picture)
    number = len(result.views) - 1
    seen = result.views[number]
    row = int(seen.in_view[11])
    # where overlay draws the point: below the captions, the third image in the second row
    scale = (897 if rings else 1800) / seen.view.masks.width
    x, y = (seen.pixels[11] + 0.5) * scale + ((0, 598 + 2 * 30) if rings else (0, 0))
    outcome = command("explain", f"{x:.2f},{y:.2f}", path, "--on", tmp_path / "a.png")
    assert outcome.exit_code == 0, outcome.output
    assert outcome.output.startswith(f"Point {row} is ")
    assert (" of c: " in outcome.output) == rings


@pytest.mark.parametrize(
    ("words", "message"),
    [
        pytest.param(["3,4", "--on", "{other}"], "a picture of 30 x 40 pixels (height x width) is no", id="other"),
        pytest.param(["0,899", "--on", "{own}", "--camera", "a"], "whose pixels tell their camera", id="camera"),
        pytest.param(["7", "--on", "{own}"], "only a pixel U,V lies on a picture", id="beside a row"),
        pytest.param(["3,5", "--on", "{own}"], "3,5 lies in no image of the picture", id="on a caption"),
    ],
)
def test_misuse_of_pictures_is_one_line(ring, tmp_path, words, message):
    result, path = ring
    save_picture(tmp_path / "own.png", overlay(result))
    save_picture(tmp_path / "other.png", Image.new("RGB", (40, 30)))
    places = {"own": tmp_path / "own.png", "other": tmp_path / "other.png"}
    outcome = command("explain", words[0], path, *(word.format(**places) for word in words[1:]))
    assert outcome.exit_code == 1
    assert message in outcome.stderr


def test_a_point_far_from_the_pixel_or_place_is_not_taken(frame, tmp_path):
    path = frame[1]
    corner = command("explain", "79.4,0", path)
    assert corner.exit_code == 1
    assert "POINT: no point is near. Point " in corner.stderr
    assert "pixels away. Give " in corner.stderr and corner.stderr.endswith("needs --on PICTURE\n")
    save_picture(tmp_path / "a.png", overlay(frame[0]))
    on_picture = command("explain", "1797,11", path, "--on", tmp_path / "a.png")
    assert "POINT: no point is near. Point " in on_picture.stderr and "--on" not in on_picture.stderr
    nowhere = command("explain", "0,0,40", path)
    assert nowhere.exit_code == 1
    assert " m away. Give " in nowhere.stderr
    row = int(nowhere.stderr.split("Give ")[1].split()[0])
    assert command("explain", row, path).exit_code == 0

"""Notebooks show pictures and the table of objects."""

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

import ldls
from ldls.palette import instance_colours


def test_a_result_shows_two_pictures_and_its_objects(result) -> None:
    html = result._repr_html_()
    pictures = [Image.open(io.BytesIO(base64.b64decode(png))) for png in re.findall(r'base64,([^"]+)"', html)]
    assert [picture.width for picture in pictures] == [1200, 1200]
    rows = re.findall(r"<tr>(<td.*?)</tr>", html)
    assert len(rows) == 2
    for row, name in zip(sorted(rows), ("person", "car"), strict=True):
        assert f"<td>{name}</td>" in row
    person = next(each for each in result.objects if each.name == "person")
    red, green, blue = instance_colours([1])[0].tolist()
    row = next(row for row in rows if "person" in row)
    assert f"rgb({red}, {green}, {blue})" in row
    assert f"<td>{person.n_points}</td>" in row and f"<td>{person.distance_m:.1f} m</td>" in row


def test_the_nearest_object_is_first_and_one_without_points_last(small_scene) -> None:
    points, masks, camera = small_scene
    nowhere = np.zeros((60, 80), bool)
    masks = ldls.InstanceMasks.from_array([nowhere, *masks.to_array()], categories=[18, 1, 3])
    html = ldls.segment(points, masks, camera)._repr_html_()
    assert html.index("<td>dog</td>") > max(html.index("<td>car</td>"), html.index("<td>person</td>"))
    assert "<td>-</td><td>-</td>" in html


def test_names_cannot_bring_markup_along(small_scene) -> None:
    points, masks, camera = small_scene
    masks = ldls.InstanceMasks.from_array(masks.to_array(), categories=[1, 1], names={1: "<script>alert(1)</script>"})
    html = ldls.segment(points, masks, camera)._repr_html_()
    assert "<script" not in html
    assert "&lt;script&gt;" in html


def test_a_ring_and_an_empty_cloud_show_themselves_too(small_scene) -> None:
    points, masks, camera = small_scene
    ring = ldls.segment(points, [ldls.View(masks, camera, "left"), ldls.View(masks, camera, "right")])
    assert "2 of 2 objects found" in ring._repr_html_()
    assert "0 of 2 objects found" in ldls.segment(points[:0], masks, camera)._repr_html_()


@pytest.mark.parametrize("n_points", [500, 0])
def test_a_result_without_views_shows_its_points_from_above(small_scene, n_points) -> None:
    html = ldls.segment(small_scene[0][:n_points], [])._repr_html_()
    assert f"{n_points} points, 0 in view, 0 of 0 objects found" in html
    assert html.count("<img") == 1 and "the points from above" in html

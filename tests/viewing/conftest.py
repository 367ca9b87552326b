"""Results of a drive."""

from dataclasses import replace

import pytest

import ldls


@pytest.fixture
def two_sweeps(small_scene):
    """Two results with the same person and car, tracked, but in another order of the masks."""
    points, masks, camera = small_scene
    turned = ldls.InstanceMasks.from_array(masks.to_array()[::-1], categories=[3, 1], scores=masks.scores[::-1])
    tracks = {"person": (31, (0.0, 0.0)), "car": (300, (3.0, -4.0))}

    def tracked(result):
        known = [(each, *tracks[each.name]) for each in result.instances]
        return replace(result, instances=tuple(replace(each, track=t, velocity=v) for each, t, v in known))

    sweeps = [tracked(ldls.segment(points, each, camera)) for each in (masks, turned)]
    assert [each.name for each in sweeps[0].instances] == ["person", "car"]
    assert [each.name for each in sweeps[1].instances] == ["car", "person"]
    return sweeps

"""The sentence that says why a point has its label."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ldls.explanation import Components, Explanation, Likelihood
    from ldls.sight import Sight


def verdict_of(explanation: Explanation) -> str:
    """Why the point has its label, in a sentence."""
    point = f"Point {explanation.point}"
    if explanation.label < 0:
        return f"{point} is out of view: {_why_unseen(explanation.sights)}."
    found = explanation.components
    if found is not None and found.removed:
        given = named(explanation, found.label)
        return f"{point} is background: diffusion gave it to {given}, but it lies in a {_where(found)}."
    return f"{point} is {named(explanation, explanation.label)}: {_lead(explanation)}."


def named(explanation: Explanation, label: int) -> str:
    """Name of a label, and of an instance its number too."""
    name = explanation.names[label]
    return f"{name} (label {label})" if label > 0 else name


def percent(share: float) -> str:
    """A share in percent with one decimal; one too small for it is no 0.0."""
    return "< 0.1 %" if 0 < share < 0.0005 else f"{100 * share:.1f} %"


def count_points(count: int) -> str:
    """A number of points."""
    return f"{count:,} point{'' if count == 1 else 's'}"


def _where(found: Components) -> str:
    own, largest = found.sizes[found.own], found.sizes[0]
    if own == largest:
        return f"component of {count_points(own)}, as large as the one kept, which has the lowest row: removed"
    return f"component of {count_points(own)}, the largest has {largest:,}: removed"


def _lead(explanation: Explanation) -> str:
    winner, other = explanation.winner, explanation.runner_up
    if winner is None or winner.value <= 0:
        return "no label reached it"
    if other is None:
        return "no other label reached it"
    next_one = f"{named(explanation, other.label)} {_behind(winner, other)}"
    return f"{percent(winner.share)} of its likelihood, {next_one}"


def _behind(winner: Likelihood, other: Likelihood) -> str:
    if percent(winner.share) != percent(other.share):
        return f"comes next with {percent(other.share)}"
    ratio = (winner.value - other.value) / winner.value
    return f"comes next, {ratio:.1e} of that behind" if ratio > 0 else "has as much"


def _why_unseen(sights: tuple[Sight, ...]) -> str:
    if not sights:
        return "there is no camera"
    if sights[0].outcome == "not finite":
        return "a coordinate is not finite"
    if sights[0].outcome == "origin":
        return "it lies at (0, 0, 0), which stands for a missing return"
    if len(sights) == 1:
        return _unseen_by(sights[0])
    return f"no camera sees it; {'; '.join(_each_unseen(sights))}"


def _unseen_by(sight: Sight) -> str:
    if sight.outcome == "behind":
        return f"it is behind the camera, at a depth of {sight.depth_m:.2f} m"
    if sight.pixel is None:
        return f"it is beyond the lens of the camera, at a depth of {sight.depth_m:.2f} m"
    height, width = sight.image_size
    u, v = sight.pixel
    return f"it falls at u {u:.1f}, v {v:.1f}, outside the {width} x {height} pixels of the image"


def _each_unseen(sights: tuple[Sight, ...]) -> Iterator[str]:
    words = {"behind": "behind", "outside": "outside the image of", "beyond the lens": "beyond the lens of"}
    for outcome, where in words.items():
        cameras = [sight.camera for sight in sights if sight.outcome == outcome]
        if cameras:
            *first, last = cameras
            yield f"it is {where} {', '.join(first) + ' and ' if first else ''}{last}"

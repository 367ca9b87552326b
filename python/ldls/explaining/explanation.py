"""The record of what decided the label of a point, and the sentence that sums it up."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

from ldls.explaining.sight import Sight
from ldls.stages import GROUND_M

LOWEST_M, _ = GROUND_M


@dataclass(frozen=True, kw_only=True)
class Neighbor:
    """One of the nearest neighbours of a point, an edge from which label flows to it.

    Attributes:
        point: Its row in the cloud.
        distance_m: How far it is, in metres.
        weight: exp(-d^2 / sigma), times `ground_edges` of the parameters where the edge leaves the ground.
        leaves_ground: True if one of both belongs to the ground and the other does not, and edges between them are
            weakened.
        share: That weight over the sum of all edges of the point, its pixel edges included.
        label: Its label in the result.
        diffused_label: The same after diffusion.
    """

    point: int
    distance_m: float
    weight: float
    leaves_ground: bool
    share: float
    label: int
    diffused_label: int


@dataclass(frozen=True, kw_only=True)
class Likelihood:
    """Likelihood of one label at a point.

    Attributes:
        label: The label; 0 is the background.
        value: z after the last product.
        share: That over the sum of all labels.
    """

    label: int
    value: float
    share: float


@dataclass(frozen=True, kw_only=True)
class Edges:
    """Weights of the edges of a point, as shares of their sum.

    Attributes:
        own: Edge to itself.
        neighbors: Edges to its nearest neighbours.
        pixels: Edges to the pixels of its windows, of those too whose label does not count.
    """

    own: float
    neighbors: float
    pixels: float


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Origin of the likelihood of a point's diffused label.

    Attributes:
        own_share: Share that its own pixels bring; the others' came along edges.
        half_within_m: Distance from it within which half of the likelihood begins, in metres.
    """

    own_share: float
    half_within_m: float


@dataclass(frozen=True, kw_only=True)
class Components:
    """The connected components of the points of one diffused label.

    Attributes:
        label: The label.
        sizes: Points of each, the largest first; of equal ones the one with the lowest row of the cloud first.
        gaps_m: How near each comes to the largest, in metres.
        own: Which of them the point lies in, from 0.
        removal: True if outliers were removed, so that number 0 was kept, and parts near it.
        part_gap: Gap in metres within which a part was kept; 0 for the largest alone.
    """

    label: int
    sizes: tuple[int, ...]
    gaps_m: tuple[float, ...]
    own: int
    removal: bool
    part_gap: float

    @property
    def removed(self) -> bool:
        """True if the point lost its label to outlier removal."""
        return not self.keeps(self.own)

    def keeps(self, number: int) -> bool:
        """True if the component of that number kept its label: the largest, and parts near it."""
        if not self.removal or number == 0:
            return True
        return self.part_gap > 0 and self.gaps_m[number] <= self.part_gap


@dataclass(frozen=True, kw_only=True)
class Island:
    """The part of the whole point graph that a point lies in; no label crosses to another.

    Attributes:
        points: Points of it.
        islands: Such parts of the graph.
    """

    points: int
    islands: int


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """The facts that decided the label of one point; `verdict` sums them up in a sentence.

    Attributes:
        point: Its row in the cloud.
        xyz: Its coordinates in the lidar frame in metres.
        label: Its label: -1 out of view, 0 background, m instance m.
        diffused_label: The same after diffusion.
        names: Name of every label of the result, -1 and 0 included.
        sights: What each camera has of it.
        edges: What its edges weigh; None out of view, and for a cleared point, which has no part in the graph.
        neighbors: Its nearest neighbours, the nearest first; empty outside the graph.
        likelihoods: Likelihoods of all labels that have any, the highest first; empty outside the graph.
        provenance: Where the likelihood of the diffused label comes from.
        components: Those of its diffused label, if that is an instance.
        island: The part of the graph it lies in.
        height_m: Its height above the ground in metres; None where the parameters need no ground or none was found.
        clearance_m: Height in metres below which points of the ground are cleared; 0 for none.
        confidence: How sure its label is, 0 to 1.
        abstain: Confidence below which points became background; 0 for none.
    """

    point: int
    xyz: tuple[float, float, float]
    label: int
    diffused_label: int
    names: dict[int, str] = field(hash=False)
    sights: tuple[Sight, ...]
    edges: Edges | None = None
    neighbors: tuple[Neighbor, ...] = ()
    likelihoods: tuple[Likelihood, ...] = ()
    provenance: Provenance | None = None
    components: Components | None = None
    island: Island | None = None
    height_m: float | None = None
    clearance_m: float = 0.0
    confidence: float = 0.0
    abstain: float = 0.0

    @property
    def winner(self) -> Likelihood | None:
        """The likelihood of the diffused label; None outside the graph."""
        return next((each for each in self.likelihoods if each.label == self.diffused_label), None)

    @property
    def runner_up(self) -> Likelihood | None:
        """The highest likelihood of another label; None where there is none."""
        return next((each for each in self.likelihoods if each.label != self.diffused_label), None)

    @property
    def cleared(self) -> bool:
        """True if the point is background for it is a point of the ground that is lower than the clearance."""
        if self.label != 0 or self.height_m is None:
            return False
        return self.clearance_m > 0 and LOWEST_M < self.height_m < self.clearance_m

    @property
    def verdict(self) -> str:
        """The reason for the label of the point, in a sentence."""
        point = f"Point {self.point}"
        if self.label < 0:
            return f"{point} is out of view: {_why_unseen(self.sights)}."
        if self.cleared:
            low = f"{_height(self.height_m)}, lower than {100 * self.clearance_m:g} cm above it"
            return f"{point} is background: it is {low}."
        components = self.components
        if components is not None and components.removed:
            given = named(self, components.label)
            return f"{point} is background: diffusion gave it to {given}, but it lies in a {_where(components)}."
        if components is not None and self.label == 0:
            doubt = f"that is right with {percent(self.confidence)} only, less than {percent(self.abstain)}"
            return f"{point} is background: diffusion gave it to {named(self, components.label)}, but {doubt}."
        return f"{point} is {named(self, self.label)}: {_lead(self)}{_refused(self)}."

    def to_dict(self) -> dict[str, Any]:
        """The same as plain values that JSON can hold, the verdict first; numbers that are not finite are None."""
        return {"verdict": self.verdict, **_finite(asdict(self))}

    def __str__(self) -> str:
        return self.verdict


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


def _where(components: Components) -> str:
    own, largest = components.sizes[components.own], components.sizes[0]
    if components.part_gap == 0 and own == largest:
        return f"component of {count_points(own)}, as large as the one kept, which has the lowest row: removed"
    if components.part_gap == 0:
        return f"component of {count_points(own)}, the largest has {largest:,}: removed"
    gap = f"{components.gaps_m[components.own]:.2f} m from the largest, which has {largest:,}"
    return f"component of {count_points(own)}, {gap}: removed"


def _lead(explanation: Explanation) -> str:
    winner, other = explanation.winner, explanation.runner_up
    if winner is None or winner.value <= 0:
        return "no label reached it"
    if other is None:
        return "no other label reached it"
    next_one = f"{named(explanation, other.label)} {_behind(winner, other)}"
    return f"{percent(winner.share)} of its likelihood, {next_one}"


def away(behind_m: float) -> str:
    """How far a point is behind the object of a mask, or before it."""
    if math.isnan(behind_m):
        return "which has no object: nothing off the ground falls on its mask"
    metres = f"{abs(behind_m):.1f}" if abs(behind_m) >= 0.1 else "less than 0.1"
    return f"{metres} m {'behind' if behind_m > 0 else 'before'} it"


def _height(height_m: float | None) -> str:
    assert height_m is not None
    # rounded down, for what is below a bound to read so
    tenths_cm = math.floor(1000 * height_m)
    return f"{abs(tenths_cm) / 10:g} cm {'above' if tenths_cm >= 0 else 'below'} the ground"


def _refused(explanation: Explanation) -> str:
    """The objects that direct projection gives the point to and depth does not."""
    refused = (
        f"{named(explanation, each.label)}, {away(each.behind_m)}"
        for sight in explanation.sights
        for each in sight.window
        if each.label == sight.direct_label != explanation.label and each.behind_m
    )
    words = " and of ".join(dict.fromkeys(refused))
    return f"; it is outside the depth group of {words}" if words else ""


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
    return f"it falls at u {u:.1f}, v {v:.1f}, outside the image of {height} x {width} pixels (height x width)"


def _each_unseen(sights: tuple[Sight, ...]) -> Iterator[str]:
    words = {"behind": "behind", "outside": "outside the image of", "beyond the lens": "beyond the lens of"}
    for outcome, where in words.items():
        cameras = [sight.camera for sight in sights if sight.outcome == outcome]
        if cameras:
            *first, last = cameras
            yield f"it is {where} {', '.join(first) + ' and ' if first else ''}{last}"


def _finite(value: Any) -> Any:  # noqa: ANN401 - whatever asdict yields
    if isinstance(value, dict):
        return {str(key): _finite(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value

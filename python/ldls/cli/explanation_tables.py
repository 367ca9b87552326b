"""Tables and sentences that `ldls explain` prints below its verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.table import Table

from ldls.explaining import Components, Explanation, Likelihood, Neighbor, Sight
from ldls.explaining.explanation import away, count_points, named, percent

SHOWN_SHARE = 0.0005
"""Share below which a likelihood is not listed, for it would read 0.0 %."""
SHOWN_COMPONENTS = 8
UNSEEN = {"behind": "behind the camera", "outside": "outside the image", "origin": "at the origin"}


def tables_of(explanation: Explanation) -> Iterator[Table | str]:
    """The parts in the order in which they are printed; outside the graph, but the place and what cameras say."""
    yield _place(explanation)
    yield _course(explanation)
    yield sight_table(explanation)
    yield from depth_sentences(explanation)
    if explanation.edges is None:
        return
    yield likelihood_table(explanation)
    yield _provenance(explanation)
    yield edge_table(explanation)
    yield _island(explanation)
    if explanation.components is not None:
        yield component_table(explanation, explanation.components)


def sight_table(explanation: Explanation) -> Table:
    """Return the table of the point as each camera sees it."""
    table = Table(title="what the camera sees" if len(explanation.sights) == 1 else "what the cameras see")
    table.add_column("camera")
    table.add_column("depth", justify="right")
    table.add_column("u, v", justify="right")
    table.add_column("nearest pixel")
    table.add_column("pixels of its window")
    for sight in explanation.sights:
        table.add_row(
            sight.camera,
            "-" if sight.depth_m is None else f"{sight.depth_m:.2f} m",
            "-" if sight.pixel is None else "{:.1f}, {:.1f}".format(*sight.pixel),
            _nearest_pixel(explanation, sight),
            _window(explanation, sight),
        )
    return table


def depth_sentences(explanation: Explanation) -> Iterator[str]:
    """A sentence on each label of a window that does not count, for each camera."""
    for sight in explanation.sights:
        who = f"By {sight.camera} it is" if len(explanation.sights) > 1 else "It is"
        for each in sight.window:
            name = named(explanation, each.label)
            if each.behind_m:
                yield f"{who} outside the depth group of {name}, {away(each.behind_m)}: pixels of {name} do not count."
            elif not each.counts:
                objects = " and of ".join(named(explanation, label) for label in sight.beside)
                yield f"{who} beside the edge of {objects}, as far away: background pixels do not count."


def likelihood_table(explanation: Explanation) -> Table:
    """The likelihoods that are more than nothing, the highest first."""
    table = Table(title="likelihood after diffusion")
    table.add_column("object")
    for heading in ("likelihood", "share"):
        table.add_column(heading, justify="right")
    table.add_column("")
    listed = [each for each in explanation.likelihoods if _is_listed(explanation, each)]
    for each in listed:
        table.add_row(
            named(explanation, each.label),
            f"{each.value:.6f}",
            percent(each.share),
            _standing(explanation, each),
        )
    rest = explanation.likelihoods[len(listed) :]
    if rest:
        value, share = (sum(part) for part in zip(*((each.value, each.share) for each in rest), strict=True))
        table.add_row(f"{len(rest)} more", f"{value:.6f}", percent(share), "")
    return table


def edge_table(explanation: Explanation) -> Table:
    """The edges of the point: what each product takes of what."""
    assert explanation.edges is not None
    table = Table(title="edges: where labels flow to it from")
    table.add_column("from")
    for heading in ("distance", "weight", "share"):
        table.add_column(heading, justify="right")
    table.add_column("object")
    pixels = sum(sight.window_pixels for sight in explanation.sights)
    table.add_row("itself", "", f"{1:.4f}", percent(explanation.edges.own), "")
    for each in explanation.neighbors:
        table.add_row(
            f"point {each.point}",
            f"{each.distance_m:.3f} m",
            f"{each.weight:.4f}",
            percent(each.share),
            _object(explanation, each) + (", weakened: leaves the ground" if each.leaves_ground else ""),
        )
    table.add_row(f"its {pixels} pixels", "", "", percent(explanation.edges.pixels), _labels_of_pixels(explanation))
    return table


def component_table(explanation: Explanation, components: Components) -> Table:
    """The components of the points that diffusion gave one label, the largest and that of the point."""
    table = Table(title=f"components of {named(explanation, components.label)}")
    parts = components.removal and components.part_gap > 0
    table.add_column("points", justify="right")
    if parts:
        table.add_column("from the largest", justify="right")
    table.add_column("")
    listed = sorted({*range(min(SHOWN_COMPONENTS, len(components.sizes))), components.own})
    for number in listed:
        gap = [f"{components.gaps_m[number]:.2f} m" if number else ""] if parts else []
        table.add_row(f"{components.sizes[number]:,}", *gap, _component(components, number))
    rest = sum(components.sizes) - sum(components.sizes[number] for number in listed)
    if rest:
        table.add_row(f"{rest:,}", *([""] if parts else []), f"in {len(components.sizes) - len(listed)} more")
    return table


def _place(explanation: Explanation) -> str:
    x, y, z = explanation.xyz
    place = f"It lies at x {x:.2f}, y {y:.2f}, z {z:.2f} m in the lidar frame"
    distance = math.hypot(x, y, z)
    away = f", {distance:.1f} m away" if math.isfinite(distance) else ""
    height = explanation.height_m
    side = "" if height is None else f", {abs(height):.2f} m {'above' if height >= 0 else 'below'} the ground"
    return f"{place}{away}{side}."


def _course(explanation: Explanation) -> str:
    labels = {sight.camera: sight.direct_label for sight in explanation.sights if sight.direct_label is not None}
    if not labels:
        return ""
    direct = (
        named(explanation, label) + (f" by {camera}" if len(labels) > 1 else "") for camera, label in labels.items()
    )
    projected = f"Direct projection: {', '.join(direct)}."
    if explanation.cleared:
        return f"{projected} Near the ground: {named(explanation, 0)}."
    components, diffused = explanation.components, named(explanation, explanation.diffused_label)
    course = f"{projected} After diffusion: {diffused}."
    if components is not None and components.removal:
        part = ", a part kept beside the largest" if components.own and not components.removed else ""
        course += f" After outlier removal: {named(explanation, 0) if components.removed else diffused}{part}."
    return course


def _nearest_pixel(explanation: Explanation, sight: Sight) -> str:
    if sight.nearest_pixel is None or sight.direct_label is None:
        return UNSEEN.get(sight.outcome, sight.outcome)
    return "{}, {}: ".format(*sight.nearest_pixel) + named(explanation, sight.direct_label)


def _window(explanation: Explanation, sight: Sight) -> str:
    lines = (
        f"{each.pixels} of {sight.window_pixels}: {named(explanation, each.label)}"
        + ("" if each.counts else ", not counted")
        for each in sight.window
    )
    return "\n".join(lines) or "-"


def _is_listed(explanation: Explanation, each: Likelihood) -> bool:
    return each.share >= SHOWN_SHARE or each in (explanation.winner, explanation.runner_up)


def _standing(explanation: Explanation, each: Likelihood) -> str:
    winner = explanation.winner
    if winner is None or each.label == winner.label:
        return "the highest"
    if each is not explanation.runner_up:
        return ""
    return f"next, behind by {percent(winner.share - each.share)} of the sum"


def _provenance(explanation: Explanation) -> str:
    origin = explanation.provenance
    if origin is None:
        return ""
    return (
        f"Of the likelihood of {named(explanation, explanation.diffused_label)}, {percent(origin.own_share)} comes "
        f"from the point's own pixels, and half from pixels of points within {origin.half_within_m:.2f} m."
    )


def _object(explanation: Explanation, each: Neighbor) -> str:
    given = named(explanation, each.diffused_label)
    return given if each.label == each.diffused_label else f"background, {given} after diffusion"


def _labels_of_pixels(explanation: Explanation) -> str:
    counts = {each.counts for sight in explanation.sights for each in sight.window}
    if False not in counts:
        return ""
    return "not all labels count" if True in counts else "no label counts"


def _island(explanation: Explanation) -> str:
    island = explanation.island
    if island is None or island.islands == 1:
        return ""
    others = "other part" if island.islands == 2 else f"{island.islands - 1} other parts"
    return f"It lies in a part of the graph of {count_points(island.points)}; no label crosses to the {others}."


def _component(components: Components, number: int) -> str:
    own = "this point's" if number == components.own else ""
    if not components.removal:
        return own
    fate = "kept" if components.keeps(number) else "removed"
    return f"{own}, {fate}" if own else fate

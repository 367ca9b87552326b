"""Explanation of the label of a point, and the graph of a result built again."""

from ldls.explaining.explain import explain, influences
from ldls.explaining.explanation import Components, Edges, Explanation, Island, Likelihood, Neighbor, Provenance
from ldls.explaining.rebuilt import Rebuilt, rebuild, refused_labels
from ldls.explaining.sight import Sight, WindowCount

__all__ = [
    "Components",
    "Edges",
    "Explanation",
    "Island",
    "Likelihood",
    "Neighbor",
    "Provenance",
    "Rebuilt",
    "Sight",
    "WindowCount",
    "explain",
    "influences",
    "rebuild",
    "refused_labels",
]

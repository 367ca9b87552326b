"""Colours of instances: the hue says the category, the shade tells instances of it apart, in a drive by their tracks.

Hues are the same in every picture. They were chosen one after the other, each as far as can be from those before it and
from grey, to eyes with all three kinds of cones and to eyes that lack one. No more than eight or so can be kept well
apart for all of them, so pictures also write names. Coordinates are OKLCh (https://bottosson.github.io/posts/oklab/).
"""

from collections import Counter
from collections.abc import Iterable
from functools import cache
from itertools import zip_longest
from math import cos, radians, sin
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]

BACKGROUND: Colour = (128, 128, 128)
"""Colour of points without an object."""

HUES: tuple[tuple[float, float, float], ...] = (
    (0.74, 0.18, 56),  # orange
    (0.70, 0.14, 248),  # blue
    (0.58, 0.26, 312),  # violet
    (0.86, 0.18, 144),  # light green
    (0.58, 0.22, 24),  # red
    (0.70, 0.14, 336),  # lilac
    (0.86, 0.18, 96),  # yellow
    (0.62, 0.22, 336),  # magenta
    (0.62, 0.14, 280),  # slate blue
    (0.78, 0.14, 168),  # aquamarine
    (0.78, 0.14, 128),  # olive green
    (0.62, 0.14, 160),  # dark green
    (0.66, 0.22, 304),  # light violet
    (0.82, 0.14, 336),  # pink
    (0.66, 0.22, 0),  # crimson
    (0.66, 0.14, 56),  # brown
)
"""Lightness, chroma and hue in degrees, the best kept apart first."""
OF_EVERYDAY: dict[int, int] = {1: 0, 3: 1, 8: 2, 2: 3, 6: 4, 4: 5}
"""Hues of the categories that traffic is made of: person, car, truck, bicycle, bus, motorcycle."""
LIGHTER = (0.0, 0.08, -0.08, 0.04, -0.04, 0.12, -0.12)
"""Lightness that the shades of a hue add, in the order in which instances get them."""
LIGHTEST = 0.90
PALER = 0.65
"""Share of the chroma left to a second turn through the shades."""
# from OKLab to the cube roots of cone responses, and from these responses to linear RGB
CONE_ROOTS = np.array([[1, 0.39634, 0.21580], [1, -0.10556, -0.06385], [1, -0.08948, -1.29149]])
LINEAR_RGB = np.array([[4.07674, -3.30771, 0.23097], [-1.26844, 2.60976, -0.34132], [-0.00420, -0.70342, 1.70761]])


class Instance(Protocol):
    """What has a colour."""

    @property
    def category(self) -> int:
        """Category id."""

    @property
    def track(self) -> int:
        """Number in the drive, from 1; 0 without."""


def category_colour(category: int) -> Colour:
    """Red, green and blue, 0 to 255, of a category: the first shade of its hue, the same in every picture."""
    return _shade(_hue_of(category), 0)


def instance_colours(categories: Iterable[int], tracks: Iterable[int] = ()) -> NDArray[np.uint8]:
    """(M, 3) uint8 red, green and blue of M instances from the category id of each.

    The k-th instance of a category has the k-th shade of its hue, whatever other categories there are. After fourteen
    the shades begin again. With the number of each in its drive, `tracks` (M,), number k has the k-th shade, so that it
    keeps its colour in all sweeps.
    """
    met: Counter[int] = Counter()
    colours = []
    for category, track in zip_longest(map(int, categories), map(int, tracks), fillvalue=0):
        colours.append(_shade(_hue_of(category), track - 1 if track else met[category]))
        met[category] += 1
    return np.array(colours, np.uint8).reshape(-1, 3)


def label_colours(instances: Iterable[Instance]) -> NDArray[np.uint8]:
    """(M + 1, 3) uint8 by label: the background, and the M instances, those of a drive by their tracks."""
    pairs = [(each.category, each.track) for each in instances]
    of_instances = instance_colours((category for category, _ in pairs), (track for _, track in pairs))
    return np.vstack([[BACKGROUND], of_instances]).astype(np.uint8)


def as_tuples(colours: NDArray[np.uint8]) -> list[Colour]:
    """Colours (n, 3) one by one."""
    return [(red, green, blue) for red, green, blue in colours.tolist()]


def _hue_of(category: int) -> int:
    others = len(HUES) - len(OF_EVERYDAY)
    return OF_EVERYDAY.get(category, len(OF_EVERYDAY) + category % others)


@cache
def _shade(hue: int, instance: int) -> Colour:
    lightness, chroma, angle = HUES[hue]
    turn, place = divmod(instance % (2 * len(LIGHTER)), len(LIGHTER))
    step = LIGHTER[place]
    if lightness + step > LIGHTEST:  # no room above: go on below
        step = -step - max(LIGHTER)
    return _rgb(lightness + step, chroma, PALER**turn, radians(angle))


def _rgb(lightness: float, chroma: float, share: float, angle: float) -> Colour:
    """A share of the chroma, or of the largest that a screen can show at this lightness and hue."""
    while not _shows(_linear(lightness, chroma, angle)):
        chroma *= 0.97
    linear = _linear(lightness, share * chroma, angle).clip(0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    red, green, blue = np.round(255 * encoded).astype(int).tolist()
    return red, green, blue


def _linear(lightness: float, chroma: float, angle: float) -> NDArray[np.float64]:
    oklab = np.array([lightness, chroma * cos(angle), chroma * sin(angle)])
    return np.asarray(LINEAR_RGB @ (CONE_ROOTS @ oklab) ** 3)


def _shows(linear: NDArray[np.float64]) -> bool:
    return bool(((linear > -0.001) & (linear < 1.001)).all())

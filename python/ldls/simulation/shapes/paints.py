"""Colours, as RGB in [0, 1]."""

from __future__ import annotations

import numpy as np

from ldls.simulation.shapes.shape import Colour


def colours(codes: str) -> tuple[Colour, ...]:
    """Colours of hexadecimal codes."""
    return tuple((r / 255, g / 255, b / 255) for r, g, b in map(bytes.fromhex, codes.split()))


PAINTS = colours("8c1a1a 1f3f7a c9cbce 2f3237 e4e4e0 5c616b 33584a b98b2c 7c2f3a 4d7ea8")
SHIRTS = colours("c23f36 3568a8 e0d6c2 7b9347 6c3f6e e0932f 2c3140 b9bcc2 4d8f8b 22252b")
TROUSERS = colours("2b385c 333030 75634c 23262b 5a5f68")
SKINS = colours("d9a883 b57f5a 8a5a3c e6bd9c")
COATS = colours("c29e6b 4c3321 dbd1bd 2b2622")
PLASTER = colours("ccb88f b8947a d1ccbd b28066 a3b0b2 dbc285 99a385 a4564a")
RUBBER: Colour = (0.06, 0.06, 0.07)
GLASS: Colour = (0.12, 0.16, 0.20)
METAL: Colour = (0.55, 0.57, 0.60)
WOOD: Colour = (0.50, 0.33, 0.19)
LAMP: Colour = (0.95, 0.94, 0.86)
TAIL_LAMP: Colour = (0.72, 0.06, 0.06)
PLATE: Colour = (0.92, 0.92, 0.80)
HAIR: Colour = (0.16, 0.11, 0.08)


def pick(options: tuple[Colour, ...], rng: np.random.Generator) -> Colour:
    """One of `options`."""
    return options[int(rng.integers(len(options)))]

"""Tables of what was measured."""

from __future__ import annotations

import numpy as np
from rich.table import Table


def new_table(title: str, headings: list[str], caption: str) -> Table:
    table = Table(title=title, caption=caption)
    table.add_column(headings[0])
    for heading in headings[1:]:
        table.add_column(heading, justify="right")
    return table


def add_ratio(table: Table, name: str, peer: float, own: float) -> None:
    ratio = peer / own if own > 0 else np.inf
    table.add_row(name, f"{peer * 1e3:.1f}", f"{own * 1e3:.2f}", f"{ratio:.1f} x")

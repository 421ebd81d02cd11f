"""Drawings of the figures of pages with Matplotlib; importing this module imports Matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ._figures import NEPER

try:
    from matplotlib import pyplot
    from matplotlib.ticker import MultipleLocator
except ImportError:
    raise ImportError("drawing needs matplotlib, which is not installed: pip install matplotlib") from None

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ._figures import Curve, Panel

# Points (1/72 inch) per pixel of a page.
_POINTS = 0.75

_MARKERS = {"c": "o", "s": "s", "t": "^", "d": "D", "v": "v", "x": "x", "p": "+"}

# Matplotlib does not show this label in a legend.
_NO_LEGEND = "_nolegend_"

# Largest number of labels on an axis with a step.
_LABELS = 9


def draw_panels(
    panels: Sequence[Panel], ax: Axes | Sequence[Axes] | None, columns: int, shares_x: bool
) -> list[Axes]:
    """Draw panels into the given axes, or into those of a new figure."""
    axes = _new_axes(len(panels), columns, shares_x) if ax is None else _given(ax)
    if len(axes) != len(panels):
        raise ValueError(f"the figure has {len(panels)} panels, got {len(axes)} axes; `panel` chooses one")
    for panel, into in zip(panels, axes, strict=True):
        _draw_panel(panel, into)
        position = into.get_subplotspec()
        if ax is None and shares_x and position is not None and not position.is_last_row():
            into.set_xlabel("")
    return axes


def new_axes(ax: Axes | None) -> Axes:
    """Return the given axes, or those of a new figure."""
    return pyplot.subplots()[1] if ax is None else ax


def draw_shape(
    projected: tuple[NDArray[np.float64], NDArray[np.float64]],
    lines: Sequence[tuple[int, int]],
    names: Sequence[str],
    title: str,
    colors: tuple[str, str, str],
    ax: Axes | None,
) -> Axes:
    """Draw the lines of a structure at rest and deflected, whose points are projected, in the colors given."""
    axes = new_axes(ax)
    rest, moved = projected
    at_rest, deflected, spots = colors
    for first, second in lines:
        axes.plot(*rest[[first, second]].T, color=at_rest, linestyle="--", linewidth=0.8)
        axes.plot(*moved[[first, second]].T, color=deflected)
    axes.plot(*moved.T, "o", color=spots, markersize=4)
    for name, point in zip(names, moved, strict=True):
        axes.annotate(name, point, xytext=(5, 4), textcoords="offset points", fontsize="small")
    axes.set_title(title)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_axis_off()
    return axes


def draw_matrix(values: NDArray[np.float64], ax: Axes | None) -> Axes:
    """Draw numbers from 0 to 1 as squares, with the numbers of modes at their sides."""
    axes = new_axes(ax)
    rows, columns = values.shape
    axes.imshow(values, vmin=0, vmax=1, cmap="Blues", extent=(0.5, columns + 0.5, rows + 0.5, 0.5))
    for row, column in np.ndindex(rows, columns):
        value = values[row, column]
        axes.text(column + 1, row + 1, f"{value:.2f}", ha="center", va="center", color="w" if value > 0.6 else "k")
    axes.set_xticks(np.arange(1, columns + 1))
    axes.set_yticks(np.arange(1, rows + 1))
    axes.set_xlabel("Mode")
    axes.set_ylabel("Mode")
    return axes


def _given(ax: Axes | Sequence[Axes]) -> list[Axes]:
    return list(np.ravel(np.asarray(ax, dtype=object)))


def _new_axes(count: int, columns: int, shares_x: bool) -> list[Axes]:
    columns = min(columns, count)
    rows = -(-count // columns)
    size = (6.4 if columns == 1 else 4.4 * columns, 1.2 + 2.4 * rows)
    _, grid = pyplot.subplots(
        rows, columns, sharex="col" if shares_x else False, squeeze=False, figsize=size, layout="constrained"
    )
    axes = list(grid.ravel())
    for spare in axes[count:]:
        spare.remove()
    return axes[:count]


def _draw_panel(panel: Panel, axes: Axes) -> None:
    # Curves that are already in the axes remain visible.
    is_empty = not axes.has_data()
    for axis, set_scale, scale in (
        (panel.x, axes.set_xscale, axes.get_xscale()),
        (panel.y, axes.set_yscale, axes.get_yscale()),
    ):
        wanted = "log" if axis.is_logarithmic else "linear"
        if scale != wanted:
            set_scale(wanted)
        if is_empty and not axis.is_logarithmic:
            # Long numbers would overlap.
            axes.ticklabel_format(axis="x" if axis is panel.x else "y", scilimits=(-2, 5))
    for line in panel.references:
        across = axes.axhline if line.is_horizontal else axes.axvline
        across(line.value, color=line.color, linewidth=0.9, linestyle=_dashes(line.dash), label=line.name or _NO_LEGEND)
    for is_band in (True, False):
        for curve in panel.curves:
            if (curve.kind == "band") == is_band:
                _draw_curve(panel, curve, axes)
    axes.set_xlabel(panel.x.caption)
    axes.set_ylabel(panel.y.caption)
    if panel.title:
        axes.set_title(panel.title)
    if is_empty:
        _limit(panel, axes)
    if any([*(curve.name for curve in panel.curves), *(line.name for line in panel.references)]):
        axes.legend(fontsize="small")


def _limit(panel: Panel, axes: Axes) -> None:
    if panel.is_equal:
        axes.set_aspect("equal", adjustable="datalim")
        return
    if panel.x.range:
        axes.set_xlim(panel.x.range)
    if panel.y.range:
        axes.set_ylim(panel.y.range)
    if panel.y.step:
        low, high = axes.get_ylim()
        step = panel.y.step * np.ceil((high - low) / panel.y.step / _LABELS)
        axes.yaxis.set_major_locator(MultipleLocator(step))


def _draw_curve(panel: Panel, curve: Curve, axes: Axes) -> None:
    label, color = curve.name or _NO_LEGEND, curve.color
    if curve.kind == "band":
        upper = curve.y if curve.upper is None else curve.upper
        axes.fill_between(curve.x, curve.y, upper, color=color, alpha=0.22, linewidth=0, label=label)
        return
    if curve.std_error is not None:
        lower, upper = curve.y - 2 * curve.std_error, curve.y + 2 * curve.std_error
        if panel.y.is_decibel:
            # The band is that of the magnitude; where it reaches zero, its level ends far below.
            lower, upper = (
                curve.y + NEPER * np.log(np.maximum(1 + sign * 2 * curve.std_error / NEPER, 1e-3)) for sign in (-1, 1)
            )
        if panel.y.is_logarithmic:
            # A logarithmic axis shows no negative end of an interval.
            lower = np.maximum(lower, _least(panel, curve) / 10)
        axes.fill_between(curve.x, lower, upper, color=color, alpha=0.22, linewidth=0)
    if curve.kind == "stems":
        foot = _least(panel, curve) if panel.y.is_logarithmic else 0.0
        axes.vlines(curve.x, foot, curve.y, color=color, linewidth=_POINTS * curve.width, label=label)
        return
    has_line = curve.kind != "points"
    x, y = _broken(curve) if has_line and curve.is_wrapped else (curve.x, curve.y)
    axes.plot(
        x,
        y,
        color=color,
        label=label,
        linestyle=_dashes(curve.dash) if has_line else "none",
        linewidth=_POINTS * curve.width,
        marker=_MARKERS.get(curve.marker or "", "none"),
        markersize=4 if len(curve.x) < 200 else 2,
    )


def _least(panel: Panel, curve: Curve) -> float:
    """Return the lower end of a logarithmic axis."""
    return panel.y.range[0] if panel.y.range else float(np.min(curve.y)) / 10


def _broken(curve: Curve) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a phase with a gap where it jumps from one edge to the other."""
    jumps = np.flatnonzero(np.abs(np.diff(curve.y)) > 180.0) + 1
    return np.insert(curve.x, jumps, np.nan), np.insert(curve.y, jumps, np.nan)


def _dashes(dash: tuple[float, ...]) -> str | tuple[float, tuple[float, ...]]:
    return (0.0, tuple(_POINTS * length for length in dash)) if dash else "-"

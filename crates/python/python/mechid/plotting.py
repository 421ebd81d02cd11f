"""Plots of results with Matplotlib, each into given axes or into new ones.

Every figure of a page is one of ``result.figures``, and ``result.plot`` draws it. The functions
here draw one panel of the most frequent figures, and plots that no page has. Matplotlib is imported
when a function is called; ``pip install "mechid[plot]"`` installs it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ._figures import Chart, Figure, MatrixFigure, Phase, Quantity, Scale, ShapeFigure
from ._figures import assurance as _assurance
from ._figures import read_page as _read_page
from ._results import (
    Decayed,
    FrequencyResponses,
    Identified,
    IdentifiedBearing,
    IdentifiedResponses,
    Machine,
    Modes,
    Reconstructed,
    Sweep,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "Chart",
    "MatrixFigure",
    "ShapeFigure",
    "assurance",
    "coherence",
    "dynamic_stiffness",
    "figures",
    "force",
    "frf",
    "modes",
    "receptance",
    "response",
    "shape",
    "stabilisation",
    "sweep",
]

Shaped = Machine | Modes | Decayed | Identified | IdentifiedResponses


def figures(page: str | os.PathLike[str]) -> Mapping[str, Figure]:
    """Return the figures of a page by their names, to draw with Matplotlib.

    Pages are the HTML of ``report`` and ``to_html``, and the files that the program writes.

    Parameters
    ----------
    page : str or path
        HTML of a page, or the path of its file.

    Returns
    -------
    mapping of str to Chart, ShapeFigure or MatrixFigure

    Raises
    ------
    OSError
        If the file cannot be read.

    Examples
    --------
    >>> import mechid
    >>> from mechid import plotting
    >>> found = mechid.identify("examples/machine.csv", force="force", displacement="displacement",
    ...                         period=256)
    >>> drawn = plotting.figures(found.report(reconstruct_force=True))
    >>> print(", ".join(drawn))
    force, motion, receptance, fit, residual-spectrum, correlations, reconstructed-force
    >>> [panel.y.caption for panel in drawn["receptance"].panels(quantity="accelerance")]
    ['Accelerance (m/(s²·N))', 'Phase (°)']
    """
    return _read_page(page)


def receptance(
    found: Identified,
    motion: int = 1,
    force: int = 1,
    *,
    phase: bool = False,
    quantity: Quantity | None = None,
    scale: Scale | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Plot measured and identified response per unit force of a pair of degrees of freedom.

    Parameters
    ----------
    found : Identified
        An identification.
    motion, force : int
        Degree of freedom of the response and of the force, counted from 1. Measured points are
        shown on lines on which no other force acts, and on lines on which several records separate
        the forces.
    phase : bool
        Whether to plot the phase in degrees instead of the magnitude.
    quantity : {"receptance", "mobility", "accelerance"}, optional
        Response per unit force. Default: that of the measured quantity.
    scale : {"log", "linear", "decibel"}, optional
        Scale of the magnitude.
    ax : matplotlib.axes.Axes, optional
        Axes to plot into.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    MechidError
        If the records show no receptance.
    KeyError
        If the records show no receptance of this pair.
    """
    drawn = found.figures.get("receptance")
    if drawn is None or drawn.members == ("",):
        # This call raises the exception that states why there is no receptance.
        _ = found.frf
    driven = _channel(found, "force", force)
    pairs = (f"{_channel(found, kind, motion)} / {driven}" for kind in ("displacement", "velocity", "acceleration"))
    known = () if drawn is None else drawn.members
    pair = next((pair for pair in pairs if pair in known), f"{motion} / {force}")
    panel = 2 if phase else 1
    return found.plot("receptance", pair, panel=panel, quantity=quantity, scale=scale, ax=ax)[0]


def response(found: Identified, dof: int = 1, *, ax: Axes | None = None) -> Axes:
    """Plot the first measured response and the one that the identified machine predicts.

    Parameters
    ----------
    found : Identified
        An identification.
    dof : int
        Degree of freedom, counted from 1.
    ax : matplotlib.axes.Axes, optional
        Axes to plot into.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    MechidError
        If a record cannot be read again.
    KeyError
        If there is no such degree of freedom, or the identified system is unstable.
    """
    return found.plot("fit", dof, panel=1, ax=ax)[0]


def frf(
    found: FrequencyResponses,
    motion: int = 1,
    force: int = 1,
    *,
    panel: str | int = 1,
    quantity: Quantity | None = None,
    scale: Scale | None = None,
    phase: Phase = "wrapped",
    ax: Axes | None = None,
) -> Axes:
    """Plot a frequency response with twice its standard error; by default its magnitude.

    Parameters
    ----------
    found : FrequencyResponses
        Frequency responses.
    motion, force : int
        Degree of freedom of the response and of the force, counted from 1.
    panel : str or int
        Number or quantity of the panel: 1 is the magnitude, ``"Phase"`` the phase.
    quantity : {"receptance", "mobility", "accelerance"}, optional
        Response per unit force. Default: that of the measured quantity.
    scale : {"log", "linear", "decibel"}, optional
        Scale of the magnitude.
    phase : {"wrapped", "continuous"}
        Phase between −180° and 180°, or without jumps.
    ax : matplotlib.axes.Axes, optional
        Axes to plot into.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    KeyError
        If there is no such pair.
    """
    pair = _member(found, (motion, force))
    return found.plot("figure", pair, panel=panel, quantity=quantity, scale=scale, phase=phase, ax=ax)[0]


def coherence(found: FrequencyResponses, motion: int = 1, *, ax: Axes | None = None) -> Axes:
    """Plot the coherence of a degree of freedom, counted from 1.

    Raises
    ------
    KeyError
        If there is no such degree of freedom.
    """
    force = next((force for moved, force in found.pairs if moved == motion), 1)
    return found.plot("figure", _member(found, (motion, force)), panel="Coherence", ax=ax)[0]


def force(found: Reconstructed, dof: int = 1, *, ax: Axes | None = None) -> Axes:
    """Plot a reconstructed force over time, with twice its standard error if it is known.

    Parameters
    ----------
    found : Reconstructed
        A reconstruction.
    dof : int
        Degree of freedom, counted from 1.
    ax : matplotlib.axes.Axes, optional
        Axes to plot into.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    KeyError
        If no force was reconstructed there.
    """
    labels = [str(row["name"]) for row in found.to_dict()["forces"]]
    label = labels[dof - 1] if 1 <= dof <= len(labels) else ""
    figure = found.figures["figure"]
    for member in range(1, len(figure.members) + 1):
        if isinstance(figure, Chart) and label in (panel.y.label for panel in figure.panels(member)):
            return figure.plot(member, panel=label, ax=ax)[0]
    raise KeyError(f"no force was reconstructed on degree of freedom {dof}")


def sweep(found: Sweep, *, ax: Axes | None = None) -> Axes:
    """Plot the error over the settings of a sweep, both logarithmic."""
    return found.plot(ax=ax)[0]


def modes(machine: Shaped, *, ax: Axes | None = None) -> Axes:
    """Plot the eigenvalues of a machine in the complex plane, in rad/s."""
    axes = _new_axes(ax)
    values = np.array([mode.eigenvalue for mode in machine.modes])
    axes.plot(values.real, values.imag, "x")
    axes.axvline(0.0, color="0.7", linewidth=0.8)
    axes.set_xlabel("Real part (rad/s)")
    axes.set_ylabel("Imaginary part (rad/s)")
    return axes


def shape(machine: Shaped, mode: int = 1, *, ax: Axes | None = None) -> Axes:
    """Plot real and imaginary part of a mode shape over the degrees of freedom.

    Parameters
    ----------
    machine : Machine, Modes, Decayed, Identified or IdentifiedResponses
        A result with modes.
    mode : int
        Number of the mode, counted from 1.
    ax : matplotlib.axes.Axes, optional
        Axes to plot into.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    IndexError
        If there is no such mode.
    """
    if mode < 1:
        raise IndexError(f"modes are counted from 1, not {mode}")
    axes = _new_axes(ax)
    values = np.asarray(machine.modes[mode - 1].shape)
    places = np.arange(1, len(values) + 1)
    axes.axhline(0.0, color="0.7", linewidth=0.8)
    axes.plot(places, values.real, "o-", label="real part")
    axes.plot(places, values.imag, "s--", label="imaginary part")
    axes.set_xticks(places)
    axes.set_xlabel("Degree of freedom")
    axes.set_ylabel("Mode shape")
    axes.legend()
    return axes


def assurance(machine: Shaped, *, ax: Axes | None = None) -> Axes:
    """Plot the modal assurance criterion of each pair of modes as squares with numbers."""
    from ._drawing import draw_matrix

    return draw_matrix(_assurance(np.array([mode.shape for mode in machine.modes])), ax)


def stabilisation(found: Modes, *, ax: Axes | None = None) -> Axes:
    """Plot the poles of models of rising order, with the mode indicator of forced tests behind them.

    Parameters
    ----------
    found : Modes
        Modes that were found with ``diagrams=True``.
    ax : matplotlib.axes.Axes, optional
        Axes to plot into.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the result has no diagrams.
    """
    diagrams = found.diagrams
    if diagrams is None:
        raise ValueError("the result has no diagrams: find the modes with diagrams=True")
    axes = _new_axes(ax)
    poles, indicator = diagrams["stabilisation"], diagrams.get("mode_indicator")
    order, frequency = np.array(poles["order"]), np.array(poles["frequency_hz"])
    stable = np.array(poles["is_stable"], dtype=bool)
    axes.plot(frequency[stable], order[stable], "o", color="C0", label="stable")
    axes.plot(frequency[~stable], order[~stable], "x", color="0.6", label="not stable")
    axes.set_xlabel("Frequency (Hz)")
    axes.set_ylabel("Order of the model")
    axes.legend()
    if indicator is not None:
        behind = axes.twinx()
        for values in indicator["singular_values"]:
            behind.semilogy(indicator["frequency_hz"], values, color="0.7", linewidth=0.9, zorder=0)
        behind.set_ylabel("Singular value")
    return axes


def dynamic_stiffness(
    found: IdentifiedBearing, force: int = 1, motion: int = 1, *, ax: Axes | None = None
) -> Axes:
    """Plot an entry of the measured dynamic stiffness of a bearing, with twice its standard errors.

    Lines show K − ω² M and ω C of the coefficients.

    Parameters
    ----------
    found : IdentifiedBearing
        An identified bearing.
    force, motion : int
        Direction of the force and of the displacement: 1 is x, 2 is y.
    ax : matplotlib.axes.Axes, optional
        Axes to plot into.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    IndexError
        If a direction is neither 1 nor 2.
    """
    if not {force, motion} <= {1, 2}:
        raise IndexError(f"a bearing has the directions 1 and 2, not {force} and {motion}")
    rows = found.to_dict()["dynamic_stiffness"]
    frequency = np.array([row["frequency_hz"] for row in rows])
    place, omega = 2 * (force - 1) + motion - 1, 2 * np.pi * frequency
    entry = (force - 1, motion - 1)
    model = {
        "real": found.stiffness[entry] - omega**2 * found.mass[entry],
        "imaginary": omega * found.damping[entry],
    }
    axes = _new_axes(ax)
    for (part, line), marker in zip(model.items(), "os", strict=True):
        values = np.array([row[part][place] for row in rows])
        errors = [row.get(f"standard_error_{part}") for row in rows]
        known = all(error is not None for error in errors)
        bars = [2 * error[place] for error in errors] if known else None
        drawn = axes.errorbar(frequency, values, yerr=bars, fmt=marker, markersize=4, label=f"{part} part")
        axes.plot(frequency, line, color=drawn[0].get_color())
    axes.set_xlabel("Frequency (Hz)")
    axes.set_ylabel("Dynamic stiffness (N/m)")
    axes.legend()
    return axes


def _channel(found: Identified, quantity: str, dof: int) -> str:
    """Return the name of a channel as the page writes it."""
    columns = found.to_dict()["channels"][quantity]
    name = columns[dof - 1] if 1 <= dof <= len(columns) else "0"
    return f"{quantity} {dof}" if name == "0" else str(name)


def _member(found: FrequencyResponses, pair: tuple[int, int]) -> int:
    """Return the number of a pair among the figures of the page, from 1."""
    if pair not in found.pairs:
        raise KeyError(pair)
    return found.pairs.index(pair) + 1


def _new_axes(ax: Axes | None) -> Axes:
    from ._drawing import new_axes

    return new_axes(ax)

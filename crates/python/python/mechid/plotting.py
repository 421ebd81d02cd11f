"""Plots of results with Matplotlib, each into the axes given or into new ones.

Matplotlib is imported when a function is called: ``pip install "mechid[plot]"`` brings it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

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

Shaped = Machine | Modes | Decayed | Identified | IdentifiedResponses


def receptance(
    found: Identified, motion: int = 1, force: int = 1, *, phase: bool = False, ax: Axes | None = None
) -> Axes:
    """Plot measured and identified receptance of a pair of degrees of freedom, counted from 1.

    Parameters
    ----------
    found : Identified
        An identification.
    motion, force : int
        Degree of freedom that moves and the one that is driven. Measured points are shown on lines
        where no other force acts.
    phase : bool
        Whether to plot the phase in degrees instead of the magnitude in m/N.
    ax : matplotlib.axes.Axes, optional
        Axes to plot into.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    MechidError
        If the records show no receptance.
    """
    table = found.frf
    frequency, measured = table.frequency_hz, table.measured[:, motion - 1, force - 1]
    fine = np.linspace(frequency.min(), frequency.max(), 801)
    model = found.machine().receptance(fine)[:, motion - 1, force - 1]
    shown = _degrees if phase else np.abs
    axes = _axes(ax)
    axes.plot(fine, shown(model), label="identified")
    axes.plot(frequency, shown(measured), ".", label="measured")
    axes.set_xlabel("Frequency (Hz)")
    axes.set_ylabel("Phase (°)" if phase else "Receptance (m/N)")
    if not phase:
        axes.set_yscale("log")
    axes.legend()
    return axes


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
        If the identified system is unstable.
    """
    (kind, (measured, predicted)) = next(iter(found.compared.items()))
    axes = _axes(ax)
    time = np.arange(len(measured)) / found.to_dict()["window"]["sample_rate_hz"]
    axes.plot(time, measured[:, dof - 1], label="measured")
    axes.plot(time, predicted[:, dof - 1], "--", label="predicted")
    units = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s²"}
    axes.set_xlabel("Time (s)")
    axes.set_ylabel(f"{kind.capitalize()} ({units[kind]})")
    axes.legend()
    return axes


def frf(
    found: FrequencyResponses, motion: int = 1, force: int = 1, *, ax: Axes | None = None
) -> Axes:
    """Plot the magnitude of a frequency response.

    Parameters
    ----------
    found : FrequencyResponses
        Frequency responses.
    motion, force : int
        Degree of freedom that moves and the one that is driven, counted from 1.
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
    axes = _axes(ax)
    axes.plot(found.frequency_hz, np.abs(found.response(motion, force)))
    axes.set_yscale("log")
    axes.set_xlabel("Frequency (Hz)")
    axes.set_ylabel(f"Magnitude ({found.unit})")
    return axes


def coherence(found: FrequencyResponses, motion: int = 1, *, ax: Axes | None = None) -> Axes:
    """Plot the coherence of a degree of freedom, counted from 1.

    Raises
    ------
    KeyError
        If there is no such degree of freedom.
    """
    axes = _axes(ax)
    axes.plot(found.frequency_hz, found.coherence(motion))
    axes.set_xlabel("Frequency (Hz)")
    axes.set_ylabel("Coherence")
    axes.set_ylim(0, 1.05)
    return axes


def force(found: Reconstructed, dof: int = 1, *, ax: Axes | None = None) -> Axes:
    """Plot a reconstructed force over time, with twice its standard error where that is known.

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
    """
    axes = _axes(ax)
    values, error = found.force[:, dof - 1], found.std_error
    axes.plot(found.time, values)
    if error is not None:
        width = 2 * error[:, dof - 1]
        axes.fill_between(found.time, values - width, values + width, alpha=0.3)
    axes.set_xlabel("Time (s)")
    axes.set_ylabel("Force (N)")
    return axes


def sweep(found: Sweep, *, ax: Axes | None = None) -> Axes:
    """Plot the error over the settings of a sweep, both logarithmic."""
    axes = _axes(ax)
    axes.loglog(found.values, found.error)
    axes.set_xlabel({"npi": "NPI", "rate_hz": "Rate (Hz)"}.get(found.settings["kind"], "Decimation"))
    axes.set_ylabel("Relative error")
    return axes


def modes(machine: Shaped, *, ax: Axes | None = None) -> Axes:
    """Plot the eigenvalues of a machine in the complex plane, in rad/s."""
    axes = _axes(ax)
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
        Something with modes.
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
    axes = _axes(ax)
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
    axes = _axes(ax)
    shapes = np.array([mode.shape for mode in machine.modes])
    power = np.sum(np.abs(shapes) ** 2, axis=1)
    values = np.abs(shapes.conj() @ shapes.T) ** 2 / np.outer(power, power)
    numbers = np.arange(1, len(shapes) + 1)
    axes.imshow(values, vmin=0, vmax=1, cmap="Blues", extent=(0.5, len(shapes) + 0.5, len(shapes) + 0.5, 0.5))
    for row, column in np.ndindex(values.shape):
        value = values[row, column]
        axes.text(column + 1, row + 1, f"{value:.2f}", ha="center", va="center", color="w" if value > 0.6 else "k")
    axes.set_xticks(numbers)
    axes.set_yticks(numbers)
    axes.set_xlabel("Mode")
    axes.set_ylabel("Mode")
    return axes


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
    axes = _axes(ax)
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
    axes = _axes(ax)
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


def _degrees(values: np.ndarray[tuple[int], np.dtype[np.complex128]]) -> np.ndarray[
    tuple[int], np.dtype[np.float64]
]:
    return np.angle(values, deg=True)


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ImportError(
            "this needs matplotlib, which is not installed: pip install matplotlib"
        ) from None

    return pyplot.subplots()[1]

"""The questions one asks of a record; each is a function."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias, Unpack

from . import _mechid
from ._records import Measurement, RecordOptions, measurements
from ._results import Identified

Method: TypeAlias = Literal["least-squares", "instrumental", "maximum-likelihood"]
Estimator: TypeAlias = Literal["h1", "h2", "hv"]
Weight: TypeAlias = Literal["hann", "hamming", "blackman", "rectangular"]


def identify(
    *sources: object,
    method: Method | None = None,
    lines: str | None = None,
    band_hz: tuple[float, float] | None = None,
    mass: float | Sequence[float | None] | None = None,
    domain: Literal["frequency", "time"] = "frequency",
    from_frf: Estimator | None = None,
    segment: int | None = None,
    segment_window: Weight | None = None,
    segment_overlap: float | None = None,
    between_samples: Literal["euler", "held", "linear"] | None = None,
    extent: Literal["open", "period"] | None = None,
    derivatives: str | None = None,
    refine: int | None = None,
    interpolation: Literal["linear", "spline", "band-limited"] | None = None,
    validate: Measurement | None = None,
    validate_start: int | None = None,
    validate_samples: int | None = None,
    settings: dict[str, Any] | None = None,
    threads: int | None = None,
    **record: Unpack[RecordOptions],
) -> Identified:
    """Identify mass, damping and stiffness from measured forces and responses.

    Every option of the program's ``mechid identify`` is a keyword of the same name.

    Parameters
    ----------
    *sources
        One or several records, fitted together: files by path, tables (data frames, xarray datasets,
        mappings, SEP 5 channels), or `Measurement` objects. Or the force and the displacement as
        arrays of shape (samples,) or (samples, degrees of freedom), in N and m.
    method : {"least-squares", "instrumental", "maximum-likelihood"}, optional
        Estimator of the parameters from spectra; least squares unless `from_frf` is given, then
        maximum likelihood.
    lines : str, optional
        Spectral lines: ``"all"``, ``"odd"``, ``"even"``, or numbers and ranges such as
        ``"1:2:335"``; every line at which the force exceeds its noise, without.
    band_hz : (float, float), optional
        Use the lines with force between two frequencies, in Hz.
    mass : float or sequence of float or None, optional
        Known masses in kg, one per degree of freedom or all entries row by row; None for an unknown
        one.
    domain : {"frequency", "time"}
        Domain of the fit.
    from_frf : {"h1", "h2", "hv"}, optional
        Fit frequency responses, averaged over segments.
    segment, segment_window, segment_overlap : optional
        Samples of a segment, its weights, and the part that the next one repeats, in per cent.
    between_samples : {"euler", "held", "linear"}, optional
        Assumption on the force between samples, in the time domain.
    extent : {"open", "period"}, optional
        Extent of the window, in the time domain.
    derivatives : str, optional
        How to find what was not measured: ``"spectral"`` or ``"savitzky-golay:WINDOW:ORDER"``.
    refine, interpolation : optional
        Steps in every sampling interval, and the interpolation between the samples.
    validate, validate_start, validate_samples : optional
        Record to predict that is not fitted, its first sample counted from 1 and their number.
    settings : dict, optional
        ``settings`` of another result, instead of the options above.
    threads : int, optional
        Number of threads; as many as there are processors, without.
    **record
        What is in the records, as `RecordOptions`: ``force``, ``displacement``, ``velocity``,
        ``acceleration``, ``fs``, ``start``, ``period``, ``periods``, ``time``, ``skip_lines``,
        ``detrend``.

    Returns
    -------
    Identified

    Raises
    ------
    MechidError
        If a record cannot be read, or the fit fails; the message says why.
    TypeError
        If an array holds other than real numbers, or options do not go together.

    Examples
    --------
    >>> import mechid
    >>> found = mechid.identify("examples/machine.csv", force="force",
    ...                         displacement="displacement", period=256)
    >>> sorted(found.parameters)
    ['c', 'k', 'm']
    """
    records = measurements(sources, "identify", record)
    if settings is None:
        fit = _fit(
            method, domain, from_frf, _segments(from_frf, segment, segment_window, segment_overlap),
            between_samples, extent, derivatives, refine, interpolation,
        )
        if domain == "time" and (lines is not None or band_hz is not None):
            raise TypeError("`lines` and `band_hz` belong to domain='frequency'")
        settings = {"fit": fit, "lines": _lines(lines, band_hz), "mass": _mass(mass)}
    predicted = None
    if validate is not None or validate_start is not None or validate_samples is not None:
        if validate is None and validate_start is None:
            raise TypeError("`validate_samples` of which record? Give `validate`, or `validate_start`")
        other = records[0] if validate is None else validate
        window = {"start": validate_start, "samples": validate_samples}
        predicted = (other._inner, json.dumps(window))
    inner = _mechid.identify(
        [record._inner for record in records], json.dumps(settings), predicted, threads
    )
    return Identified(inner)


def _fit(
    method: str | None,
    domain: str,
    from_frf: str | None,
    segments: dict[str, Any],
    between_samples: str | None,
    extent: str | None,
    derivatives: str | None,
    refine: int | None,
    interpolation: str | None,
) -> dict[str, Any]:
    of_time = {
        "between_samples": between_samples,
        "extent": extent,
        "derivatives": derivatives,
        "refine": refine,
        "interpolation": interpolation,
    }
    if domain == "time":
        _refuse({"method": method, "from_frf": from_frf}, "belongs to domain='frequency'")
        if (refine is None) != (interpolation is None):
            raise TypeError("`refine` and `interpolation` go together")
        return {
            "domain": "samples",
            "between_samples": between_samples,
            "extent": {"period": "whole_period"}.get(extent or "", extent),
            "derivatives": _derivatives(derivatives),
            "refine": None
            if refine is None
            else {"factor": refine, "interpolation": interpolation},
        }
    if domain != "frequency":
        raise ValueError(f"`domain` is frequency or time, got {domain!r}")
    _refuse(of_time, "belongs to domain='time'")
    if from_frf is not None:
        return {
            "domain": "responses",
            "estimator": from_frf,
            "segments": segments,
            "method": method,
        }
    return {"domain": "spectra", "method": method or "least-squares"}


def _refuse(options: dict[str, Any], why: str) -> None:
    for name, value in options.items():
        if value is not None:
            raise TypeError(f"`{name}` {why}")


def _segments(
    belongs: object, segment: int | None, window: str | None, overlap: float | None
) -> dict[str, Any]:
    if belongs is None:
        _refuse({"segment": segment}, "belongs to `from_frf`")
    if segment is None:
        _refuse({"segment_window": window, "segment_overlap": overlap}, "needs `segment`")
    kept = {"segment": segment, "window": window, "overlap_percent": overlap}
    return {name: value for name, value in kept.items() if value is not None}


def _lines(lines: str | None, band_hz: tuple[float, float] | None) -> Any:
    if lines is not None and band_hz is not None:
        raise TypeError("either `lines` or `band_hz`")
    if lines is not None:
        return {"lines": lines}
    if band_hz is not None:
        low, high = band_hz
        return {"band": {"low_hz": float(low), "high_hz": float(high)}}
    return "driven"


def _mass(mass: float | Sequence[float | None] | None) -> list[float | None]:
    if mass is None:
        return []
    if isinstance(mass, Sequence):
        return [None if value is None else float(value) for value in mass]
    return [float(mass)]


def _derivatives(text: str | None) -> Any:
    if text is None or not text.startswith("savitzky-golay:"):
        return text
    _, window, order = (text + "::").split(":")[:3]
    if not (window.isdecimal() and order.isdecimal()):
        raise ValueError(f"`derivatives` is spectral or savitzky-golay:WINDOW:ORDER, got {text!r}")
    return {"savitzky-golay": {"window": int(window), "order": int(order)}}

"""Functions that analyse records: one for each question about a machine."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Unpack

import numpy as np

from . import _mechid
from ._errors import careful
from ._mapping import ReadOnly
from ._records import (
    Measurement,
    RecordOptions,
    ResponseTable,
    Window,
    _index,
    matrix,
    measurements,
    only_window,
    plan_of,
    reading_of,
)
from ._results import (
    BearingTable,
    Decayed,
    FrequencyResponses,
    Identified,
    IdentifiedBearing,
    IdentifiedElements,
    IdentifiedResponses,
    Inspected,
    Machine,
    ModeComparison,
    Modes,
    Multisine,
    Reconstructed,
    SelectedModes,
    Simulation,
    Sweep,
    description_of,
    listed,
    machine_of,
    system_of,
    one,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Method: TypeAlias = Literal["least-squares", "instrumental", "maximum-likelihood"]
Estimator: TypeAlias = Literal["h1", "h2", "hv"]
ForceMethod: TypeAlias = Literal[
    "auto",
    "continuous",
    "discretised",
    "frequency-domain",
    "shrinkage",
    "tikhonov",
    "truncated-svd",
    "kalman",
]
Scheme: TypeAlias = Literal[
    "exact",
    "newmark",
    "central-difference",
    "houbolt",
    "wilson-theta",
    "generalised-alpha",
    "hht-alpha",
    "wbz-alpha",
    "bathe",
    "rho-infinity-bathe",
    "matrix-exponential",
    "runge-kutta-4",
]
SweepEstimator: TypeAlias = Literal[
    "euler", "held", "linear", "equation-of-motion", "least-squares", "maximum-likelihood"
]


@careful
def identify(
    *sources: object,
    method: Method | None = None,
    noise: str | None = None,
    force_noise: float | Sequence[float] | None = None,
    lines: str | None = None,
    band_hz: tuple[float, float] | None = None,
    without_lines: str | None = None,
    without_hz: Sequence[float | Mapping[str, Any]] = (),
    mass: float | Sequence[float | None] | None = None,
    structure: str | Sequence[str] = (),
    domain: Literal["frequency", "time"] = "frequency",
    from_frf: Estimator | None = None,
    segment: int | str | Mapping[str, Any] | None = None,
    between_samples: Literal["euler", "held", "linear"] | None = None,
    ac_coupling: Sequence[str | Mapping[str, Any]] = (),
    extent: Literal["open", "period"] | None = None,
    hits: bool | str | Mapping[str, Any] = False,
    derivatives: str | None = None,
    refine: str | Mapping[str, Any] | None = None,
    nonlinear: str | None = None,
    candidates: str | None = None,
    criterion: Literal["information", "held-out"] | None = None,
    search: Sequence[Literal["laws", "delay", "phase"]] = (),
    weighting: Literal["automatic", "white-force", "response", "smooth-spectrum"] | None = None,
    validate: Measurement | Mapping[str, Any] | None = None,
    settings: dict[str, Any] | None = None,
    time_limit: float | None = None,
    threads: int | None = None,
    **record: Unpack[RecordOptions],
) -> Identified:
    """Identify mass, damping and stiffness from measured forces and responses.

    Every option of ``mechid identify`` is a keyword of the same name, except the options of
    ``--machine``: these are keywords of `identify_elements`.

    Parameters
    ----------
    *sources
        One or several records, fitted together: files by path, tables (data frames, xarray datasets,
        mappings, SEP 5 channels), or `Measurement` objects. Or the force and the displacement as
        arrays of shape (samples,) or (samples, degrees of freedom), in N and m.
    method : {"least-squares", "instrumental", "maximum-likelihood"}, optional
        Estimator of the parameters. Default: maximum likelihood if the noise is known from at least
        two periods, if noise biases least squares, or with `from_frf`; otherwise least squares.
    noise : str, optional
        Noise spectrum that weights the lines in maximum likelihood: ``"white"``, ``"smooth"``,
        ``"neighbours:N"`` (means over N lines to either side), ``"per-line"``, or ``"auto"`` for an
        automatic choice.
    force_noise : float or sequence of float, optional
        Standard deviation of the noise on the force samples, in N: one value for all forces, or one
        per degree of freedom. It is for open records: with it, the record is fitted as an open
        record. Default: estimated above the excited band, or between hits.
    lines : str, optional
        Spectral lines: ``"all"``, ``"odd"``, ``"even"``, or numbers and ranges such as
        ``"1:2:335"``. Default: every line at which the force exceeds its noise.
    band_hz : (float, float), optional
        Use the lines with force between two frequencies, in Hz.
    without_lines : str, optional
        Lines to exclude, numbers and ranges as for `lines`.
    without_hz : sequence of float or dict, optional
        Frequencies whose lines are excluded, in Hz: a number, or a dict of ``frequency_hz``,
        ``half_width_hz`` and ``multiples`` (True for a rotation).
    mass : float or sequence of float or None, optional
        Known masses in kg, one per degree of freedom or all entries row by row; None for an unknown
        one.
    structure : str or sequence of str
        Known structure of M, C and K: ``"symmetric"``, ``"chain"`` (masses in a row, with
        springs and dampers to neighbours and to the ground), ``"diagonal-mass"``,
        ``"proportional-damping"`` (C = αM + βK), or an entry such as ``"k13=0"``.
    domain : {"frequency", "time"}
        Domain of the fit.
    from_frf : {"h1", "h2", "hv"}, optional
        Fit frequency responses, averaged over segments.
    segment : int or str or dict, optional
        Samples of a segment; ``"1024:50:hann"`` adds the overlap in per cent and the window
        (hann, hamming, blackman, rectangular). A dict has the keys ``segment``, ``overlap_percent``
        and ``window``.
    between_samples : {"euler", "held", "linear"}, optional
        Assumed force between the samples: held or linear for open records, hits and the time
        domain, euler for the time domain only. Default: band-limited.
    ac_coupling : sequence of str or dict
        Channels behind a first-order high-pass filter, for open records and hits, such as
        ``"a1=0.5"`` with the corner frequency in Hz, or a dict of ``channel`` and ``corner_hz``.
    extent : {"open", "period"}, optional
        Extent of the window: open (any part of a response; its transient is estimated with the
        machine) or period (whole periods). Default: in the time domain open, or period with
        spectral derivatives. In the frequency domain period if `period` is given; otherwise open
        for nonlinear terms, and for a linear machine period unless a transient is found.
    hits : bool or str or dict, optional
        Divide the records of a hammer test into hits, exclude bad ones and fit each of the others
        as a separate record. The rule is changed by a text such as ``"trigger=0.5,double=5"``, or
        by a dict of ``trigger_percent``, ``double_percent``, ``weak_percent``, ``bounce_s``, and
        the numbers of samples ``before`` (before the pulse) and ``samples`` (of the whole hit).
    derivatives : str, optional
        Method for the responses that were not measured: ``"spectral"`` or
        ``"savitzky-golay:WINDOW:ORDER"``.
    refine : str or dict, optional
        Number of steps in every sampling interval, and interpolation between the samples (linear,
        spline, band-limited), such as ``"8:band-limited"``.
    nonlinear : str, optional
        Springs and dampers to fit in addition to mass, damping and stiffness, such as ``"k3:
        x1^3, c2: |v1| v1"``.
    candidates : str, optional
        Candidate terms, written as for `nonlinear`; those that improve the fit are added.
    criterion : {"information", "held-out"}, optional
        Criterion for the addition of a candidate: the extended Bayesian information criterion, or
        the error with which the fit to the other records predicts each record (at least three
        records).
    search : sequence of {"laws", "delay", "phase"}
        Further constants to estimate: those inside the laws, the delay of the force, a phase error
        common to all channels.
    weighting : {"automatic", "white-force", "response", "smooth-spectrum"}, optional
        Weighting of the lines of a fit with nonlinear terms.
    validate : Measurement or dict, optional
        Record that is predicted and not fitted. A dict of ``record``, ``start`` (first sample,
        counted from 1) and ``samples`` (number of samples) selects a part of it; without
        ``record``, a part of the first fitted record.
    settings : dict, optional
        ``settings`` of another result, instead of the options above; the keys are those options.
    time_limit : float, optional
        Time in s after which all searches end at their best points so far; the result then says
        that it is not final. Default: a limit of the work that grows with the size of the data.
    threads : int, optional
        Number of threads. Default: one per processor.
    **record
        Columns and samples of the records, as in `RecordOptions`: ``force``, ``displacement``,
        ``velocity``, ``acceleration``, ``fs``, ``start``, ``period``, ``periods``, ``time``,
        ``skip_lines``, ``detrend``, ``record_column``, ``record_id``.

    Returns
    -------
    Identified

    Raises
    ------
    MechidError
        If a record cannot be read, or the fit fails; the message states the reason.
    TypeError
        If an array contains anything but real numbers, or options exclude each other.

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
        settings = _given(
            method=method, noise=noise, force_noise=_levels(force_noise), lines=lines, band_hz=band_hz,
            without_lines=without_lines, without_hz=without_hz, mass=mass, structure=structure,
            domain=domain, from_frf=from_frf, segment=segment, between_samples=between_samples,
            ac_coupling=ac_coupling, extent=extent, hits=hits, derivatives=derivatives, refine=refine, nonlinear=nonlinear,
            candidates=candidates, criterion=criterion, search=search, weighting=weighting,
        )
    told = json.dumps(settings, default=_plain)
    predicted = None
    if validate is not None:
        window = dict(validate) if isinstance(validate, Mapping) else {"record": validate}
        other = window.pop("record", None) or records[0]
        predicted = (other._inner, json.dumps(window))
    inner = _mechid.identify(
        [record._inner for record in records], told, predicted, time_limit, threads
    )
    return Identified(inner)


@careful
def identify_elements(
    *sources: object,
    machine: str | os.PathLike[str] | Mapping[str, Any],
    parts: Sequence[str | os.PathLike[str] | ResponseTable] = (),
    speed_table: bool = False,
    band_hz: tuple[float, float] | None = None,
    without_hz: Sequence[float | Mapping[str, Any]] = (),
    hits: bool | str | Mapping[str, Any] = False,
    noise: str = "auto",
    force_noise: float | Sequence[float] | None = None,
    starts: int | None = None,
    seed: int = 0,
    confidence: float = 0.95,
    time_limit: float | None = None,
    threads: int | None = None,
    **record: Unpack[RecordOptions],
) -> IdentifiedElements:
    """Identify the unknown coefficients of a machine of named elements, with sensors anywhere.

    Same as ``mechid identify --machine``.

    Parameters
    ----------
    *sources
        Records (files by path, tables, or `Measurement` objects) whose columns have the names of
        the sensors and inputs; or `ResponseTable` objects whose points have these names; or, with
        `speed_table`, files with one row per speed of a run.
    machine : path or mapping
        Description of the machine: degrees of freedom, elements, sensors and inputs, as the program
        reads it. The matrices of an element may be NumPy arrays or sparse matrices of SciPy, such
        as ``rotor.M()``, ``rotor.C(speed)``, ``rotor.G()`` and ``rotor.K(speed)`` of a ROSS rotor
        without its bearings.
    parts : sequence
        Tables of frequency responses of parts of the machine; their receptance replaces a model of
        the part.
    speed_table : bool
        Whether the sources are tables of synchronous responses over the speed.
    band_hz : (float, float), optional
        Frequencies to use, in Hz. Default: those that the inputs excite.
    without_hz : sequence of float or dict
        Frequencies whose lines are excluded, as in `identify`.
    hits : bool or str or dict, optional
        Find the hits of a hammer test and use the good ones; those without a gap are one record.
    noise : str
        Noise spectrum that weights the lines, as in `identify`.
    force_noise : float or sequence of float, optional
        Standard deviation of the noise on the samples of the forces, in N, for open records and
        hits. Default: estimated above the band that the forces excite, or between the hits.
    starts : int, optional
        Maximum number of searches. Default: 12.
    seed : int
        Seed of the random initial values.
    confidence : float
        Confidence level of the intervals, between 0 and 1.
    time_limit : float, optional
        Time in s after which all searches end at their best points so far; the result then says
        that it is not final. Default: a limit of the work that grows with the size of the data.
    threads : int, optional
        Number of threads. Default: one per processor.
    **record
        Samples of the records, as in `RecordOptions`, without columns. A record with ``period`` is
        read as whole periods, otherwise as an open record (any part of a response).

    Returns
    -------
    IdentifiedElements

    Raises
    ------
    MechidError
        If the description is inconsistent, a record cannot be read, or the data determine none of
        the unknowns.

    Examples
    --------
    >>> import mechid
    >>> foot = {"name": "foot", "at": "displacement", "k": {"start": 1e3, "min": 0}, "c": {"start": 10}}
    >>> machine = {
    ...     "dofs": ["displacement"],
    ...     "elements": [{"name": "m", "at": "displacement", "m": {"start": 20, "min": 0}}, foot],
    ...     "sensors": [{"at": "displacement", "quantity": "displacement"}],
    ...     "inputs": [{"kind": "force", "name": "force", "at": "displacement"}],
    ... }
    >>> found = mechid.identify_elements("examples/machine.csv", machine=machine, period=256)
    >>> sorted(found.parameters)
    ['foot.c', 'foot.k', 'm']
    """
    if isinstance(machine, Mapping):
        name, described, folder = "the machine", json.dumps(machine, default=listed), ""
    else:
        name, folder = os.fspath(machine), os.path.dirname(os.fspath(machine))
        with open(machine, encoding="utf-8-sig") as file:
            described = file.read()
    told, columns = (json.loads(text) for text in _mechid.described_machine(name, described, folder))
    told |= {
        "band": None if band_hz is None else {"low_hz": float(band_hz[0]), "high_hz": float(band_hz[1])},
        "without_hz": json.loads(_without(None, without_hz))["frequencies"],
        "hits": hits,
        "noise": noise,
        "force_noise": _levels(force_noise),
        "seed": _index("seed", seed) if seed else 0,
        "confidence": float(confidence),
    }
    if starts is not None:
        told["starts"] = _index("starts", starts)
    given = [one if isinstance(one, ResponseTable) else ResponseTable.read(one) for one in parts]
    of_parts = [one._inner for one in given]
    settings = json.dumps(told, default=_plain)
    if speed_table:
        paths = [os.fspath(source) for source in sources]  # type: ignore[call-overload]
        inner = _mechid.identify_elements([], [], paths, of_parts, settings, time_limit, threads)
    elif sources and all(isinstance(source, ResponseTable) for source in sources):
        tables = [source._inner for source in sources if isinstance(source, ResponseTable)]
        inner = _mechid.identify_elements([], tables, [], of_parts, settings, time_limit, threads)
    else:
        if not all(isinstance(source, Measurement) for source in sources):
            record = {**{kind: names for kind, names in columns.items() if names}, **record}
        records = [one._inner for one in measurements(sources, "identify_elements", record)]
        inner = _mechid.identify_elements(records, [], [], of_parts, settings, time_limit, threads)
    return IdentifiedElements(inner)


@careful
def identify_responses(
    *tables: str | os.PathLike[str] | ResponseTable,
    quantity: Literal["displacement", "velocity", "acceleration"] | None = None,
    averages: float | None = None,
    points: Sequence[str] = (),
    band_hz: tuple[float, float] | None = None,
    mass: float | Sequence[float | None] | None = None,
    structure: str | Sequence[str] = (),
    method: Method | None = None,
    time_limit: float | None = None,
    threads: int | None = None,
) -> IdentifiedResponses:
    """Identify mass, damping and stiffness from frequency responses measured elsewhere.

    Same as ``mechid identify --frf-table``.

    Parameters
    ----------
    *tables
        One or several tables, fitted together: texts or universal files by path, or `ResponseTable`
        objects made of arrays.
    quantity : {"displacement", "velocity", "acceleration"}, optional
        Measured quantity, if the table does not state it.
    averages : float, optional
        Number of independent averages of the coherence.
    points : sequence of str
        Points to use, one per degree of freedom. Default: all.
    band_hz : (float, float), optional
        Frequencies to use, in Hz. Default: all above zero.
    mass : float or sequence of float or None, optional
        Known masses in kg, one per degree of freedom or all entries row by row; None for an unknown
        one.
    structure : str or sequence of str
        Known structure of M, C and K, as in `identify`.
    method : {"least-squares", "instrumental", "maximum-likelihood"}, optional
        Estimator. Default: maximum likelihood.
    time_limit : float, optional
        Time in s after which all searches end at their best points so far; the result then says
        that it is not final. Default: a limit of the work that grows with the size of the data.
    threads : int, optional
        Number of threads. Default: one per processor.

    Returns
    -------
    IdentifiedResponses

    Raises
    ------
    MechidError
        If a table cannot be read or lacks a response, or the fit fails.

    Examples
    --------
    >>> import mechid, numpy as np
    >>> omega = np.linspace(10.0, 60.0, 100)
    >>> response = 1 / (5000 - omega**2 * 10 + 1j * omega * 180)
    >>> table = mechid.ResponseTable(omega / (2 * np.pi), response, quantity="displacement")
    >>> found = mechid.identify_responses(table)
    >>> round(found.parameters["k"].value, 6)
    5000.0
    """
    given = [one if isinstance(one, ResponseTable) else ResponseTable.read(one) for one in tables]
    band = None if band_hz is None else {"low_hz": float(band_hz[0]), "high_hz": float(band_hz[1])}
    settings = {
        "quantity": quantity,
        "averages": None if averages is None else float(averages),
        "points": [str(point) for point in points],
        "band": band,
        "mass": _mass(mass),
        "structure": _structure(structure),
        "method": method,
    }
    inner = _mechid.identify_responses([one._inner for one in given], json.dumps(settings), time_limit, threads)
    return IdentifiedResponses(inner)


@careful
def bearing(
    *tests: object,
    baseline: object = (),
    stator_mass: float | None = None,
    rotation_hz: float | None = None,
    load: float | None = None,
    clearance: float | None = None,
    diameter: float | None = None,
    length: float | None = None,
    viscosity: float | None = None,
    coefficients: Literal["automatic", "eight", "twelve"] = "automatic",
    lines: str | None = None,
    band_hz: tuple[float, float] | None = None,
    without_lines: str | None = None,
    without_hz: Sequence[float | Mapping[str, Any]] = (),
    frf_table: bool = False,
    averages: float | None = None,
    points: Sequence[str] = (),
    settings: dict[str, Any] | None = None,
    time_limit: float | None = None,
    threads: int | None = None,
    **record: Unpack[RecordOptions],
) -> IdentifiedBearing:
    """Identify the stiffness, damping and mass coefficients of a journal bearing from rig tests.

    Every option of ``mechid bearing``, except ``--campaign``, is a keyword of the same name.

    Parameters
    ----------
    *tests, **record
        Records as in `identify`, all at one speed and load, with the `period`: the forces of the
        shakers, the accelerations of the housing and its displacements relative to the shaft, x
        before y. Or tables of frequency responses, as `ResponseTable` objects, or by path with
        `frf_table`: alternately displacement and acceleration per shaker force.
    baseline : object or sequence
        Baseline tests (no film, shaft at rest), in the same form as the tests.
    stator_mass : float
        Mass of the housing and all parts that move with it, in kg.
    rotation_hz : float, optional
        Speed of rotation in Hz; lines at this frequency and its multiples are excluded.
    load : float, optional
        Static load, in N.
    clearance, diameter, length, viscosity : float, optional
        Size of the bearing in m, and viscosity of the oil in Pa·s, for dimensionless coefficients and the
        Sommerfeld number.
    coefficients : {"automatic", "eight", "twelve"}
        Coefficients to identify. Default: chosen by a likelihood-ratio test at 5 %.
    lines, band_hz, without_lines, without_hz : optional
        Spectral lines, as in `identify`.
    frf_table : bool
        Whether paths name tables of frequency responses.
    averages : float, optional
        Number of independent averages of the coherence of tables.
    points : sequence of str
        Two points of the tables to use, x before y. Default: all.
    settings : dict, optional
        ``settings`` of another result, instead of the options above.
    time_limit : float, optional
        Time in s after which all searches end at their best points so far; the result then says
        that it is not final. Default: a limit of the work that grows with the size of the data.
    threads : int, optional
        Number of threads. Default: one per processor.

    Returns
    -------
    IdentifiedBearing

    Raises
    ------
    MechidError
        If a record cannot be read, a setting is not positive, or the tests excite one direction only.

    Examples
    --------
    >>> import mechid
    >>> found = mechid.bearing(
    ...     "examples/bearing-rig.csv", baseline="examples/bearing-dry.csv", force=["fx", "fy"],
    ...     acceleration=["ax", "ay"], displacement=["dx", "dy"], period=256, stator_mass=20,
    ...     rotation_hz=50)
    >>> print(f"{found.coefficients['kxy'].value:.3g} N/m")
    9.26e+07 N/m
    """
    if settings is None:
        settings = {
            "stator_mass": 0.0 if stator_mass is None else float(stator_mass),
            "rotation_hz": rotation_hz,
            "load": load,
            "size": {
                "clearance": clearance, "diameter": diameter, "length": length, "viscosity": viscosity,
            },
            "coefficients": coefficients,
            "lines": _lines(lines, band_hz),
            "without": json.loads(_without(without_lines, without_hz)),
            "averages": None if averages is None else float(averages),
            "points": [str(point) for point in points],
        }
    dry = list(baseline) if isinstance(baseline, (list, tuple)) else [baseline]
    if frf_table or any(isinstance(test, ResponseTable) for test in tests):
        if record:
            raise TypeError(f"`{next(iter(record))}` belongs to records, not to frequency responses")
        inner = _mechid.bearing_of_responses(
            _response_tables(tests), _response_tables(dry), json.dumps(settings), time_limit, threads
        )
    else:
        wet = measurements(tests, "bearing", record)
        still = measurements(dry, "bearing", record) if dry else []
        inner = _mechid.bearing(
            [one._inner for one in wet], [one._inner for one in still], json.dumps(settings), time_limit, threads
        )
    return IdentifiedBearing(inner)


@careful
def bearing_campaign(
    campaign: Mapping[str, Any] | str | os.PathLike[str], *, threads: int | None = None
) -> BearingTable:
    """Identify the coefficients of a bearing at several speeds and loads.

    Parameters
    ----------
    campaign : mapping or path
        Description, or its JSON file. It has a list ``points``; each point has ``tests``,
        ``baseline``, ``rotation_hz`` and ``load``. Common to all points are ``channels``,
        ``window`` (or ``frf_table``), ``baseline`` and ``settings`` as in `bearing`.
    threads : int, optional
        Number of threads. Default: one per processor.

    Returns
    -------
    BearingTable

    Raises
    ------
    MechidError
        If the description is wrong, a record cannot be read, or a bearing cannot be identified.
    """
    if isinstance(campaign, Mapping):
        text = json.dumps(campaign, default=listed)
    else:
        text = Path(campaign).read_text(encoding="utf-8")
    return BearingTable(_mechid.bearing_campaign(text, threads))


def _response_tables(sources: Sequence[object]) -> list[_mechid.ResponseTable]:
    read = (one if isinstance(one, ResponseTable) else ResponseTable.read(one) for one in sources)  # type: ignore[arg-type]
    return [table._inner for table in read]


@careful
def frf(
    *sources: object,
    estimator: Estimator = "h1",
    lines: str | None = None,
    band_hz: tuple[float, float] | None = None,
    without_lines: str | None = None,
    without_hz: Sequence[float | Mapping[str, Any]] = (),
    segment: int | str | Mapping[str, Any] | None = None,
    hits: bool | str | Mapping[str, Any] = False,
    exponential_percent: float | None = None,
    settings: dict[str, Any] | None = None,
    threads: int | None = None,
    **record: Unpack[RecordOptions],
) -> FrequencyResponses:
    """Estimate frequency responses and coherence from measured forces and responses.

    With a periodic excitation (`period`) the periods are the segments that are averaged; for a
    random excitation give `segment`.

    Parameters
    ----------
    *sources, **record
        Record or records, as in `identify`; the segments of several records are averaged together.
    estimator : {"h1", "h2", "hv"}
        Frequency response estimator: h1 for noise on the response, h2 on the force, hv on both.
    lines, band_hz, without_lines, without_hz : optional
        Spectral lines of a segment, as in `identify`.
    segment : int or str or dict, optional
        Number of samples of a segment, with overlap and window as in `identify`.
    hits : bool or dict, optional
        Average over the good hits of a hammer test, as in `identify`.
    exponential_percent : float, optional
        Weight of an exponential window on force and response at the end of a hit, in per cent of
        its weight at the beginning.
    settings : dict, optional
        ``settings`` of another result, instead of the options above.
    threads : int, optional
        Number of threads. Default: one per processor.

    Returns
    -------
    FrequencyResponses

    Raises
    ------
    MechidError
        If the record cannot be read, no chosen line carries force, or segments are too few.
    """
    records = [measured._inner for measured in measurements(sources, "frf", record)]
    if settings is None:
        settings = {
            "estimator": estimator,
            "lines": _lines(lines, band_hz),
            "without": json.loads(_without(without_lines, without_hz)),
            "segments": {} if segment is None else segment,
            "hits": hits,
            "exponential_percent": exponential_percent,
        }
    return FrequencyResponses(_mechid.frf(records, json.dumps(settings, default=_plain), threads))


@careful
def decay(
    *sources: object,
    from_s: float | None = None,
    to_s: float | None = None,
    modes: int | None = None,
    max_modes: int = 10,
    offset: bool = True,
    settings: dict[str, Any] | None = None,
    time_limit: float | None = None,
    threads: int | None = None,
    **record: Unpack[RecordOptions],
) -> Decayed:
    """Find natural frequencies, damping ratios and shapes in a response without force.

    For a structure that was released or struck, or whose shaker was switched off.

    Parameters
    ----------
    *sources, **record
        The record: a file, table or `Measurement` with columns of one kind of response and no
        force. Give arrays by keyword: ``acceleration=a, fs=…``.
    from_s, to_s : float, optional
        Beginning of the decay and end of the part that is used, in s from the first sample of the
        window. Default: the beginning is detected, and the end is the end of the window.
    modes : int, optional
        Number of modes. Default: as many as the record shows.
    max_modes : int
        Maximum number of modes if the number is not given.
    offset : bool
        Whether each channel has an unknown constant.
    settings : dict, optional
        ``settings`` of another result, instead of the options above.
    time_limit : float, optional
        Time in s after which all searches end at their best points so far; the result then says
        that it is not final. Default: a limit of the work that grows with the size of the data.
    threads : int, optional
        Number of threads. Default: one per processor.

    Returns
    -------
    Decayed

    Raises
    ------
    MechidError
        If the record cannot be read, has no decaying oscillation, or grows.
    """
    found = one(sources, "decay", record)
    if settings is None:
        settings = {
            "from_s": None if from_s is None else float(from_s),
            "to_s": None if to_s is None else float(to_s),
            "modes": None if modes is None else _index("modes", modes),
            "max_modes": _index("max_modes", max_modes),
            "offset": bool(offset),
        }
    return Decayed(_mechid.decay(found._inner, json.dumps(settings), time_limit, threads))


@careful
def modes(
    *sources: object,
    band_hz: tuple[float, float] | None = None,
    modes: int | None = None,
    max_modes: int | None = None,
    near_hz: Sequence[float] = (),
    force_at: Sequence[str | int] = (),
    response_at: Sequence[str | int] = (),
    hits: bool | str | Mapping[str, Any] = False,
    ambient: bool = False,
    decay: bool = False,
    without_hz: Sequence[float] = (),
    without_harmonics: bool = False,
    real_shapes: bool = False,
    reciprocal: bool = False,
    validate: float = 0.0,
    quantity: Literal["displacement", "velocity", "acceleration"] | None = None,
    diagrams: bool = False,
    settings: dict[str, Any] | None = None,
    time_limit: float | None = None,
    threads: int | None = None,
    **record: Unpack[RecordOptions],
) -> Modes:
    """Find the modes of a test with forces, of tables of frequency responses, free decays, or an ambient record.

    Parameters
    ----------
    *sources, **record
        One or several records, fitted together, as in `identify`; forces and responses may belong
        to different degrees of freedom. Files without any option of a record, and `ResponseTable`
        objects, are tables of frequency responses.
    band_hz : (float, float), optional
        Frequencies to use, in Hz. Default: those that the forces excite.
    modes, max_modes : int, optional
        Number of modes to report (those that explain most), or the maximum. Default: as many as the
        record shows.
    near_hz : sequence of float
        Frequencies, in Hz: only the mode nearest to each, within 2 %, is reported, even if it is
        weak. Other modes are part of the model, but not reported. Default: all modes.
    force_at, response_at : sequence of str or int
        Points of the force and response columns, such as ``3`` or ``"12+Z"``. For a roving hammer
        (several records with one force column): the struck point of each record.
    hits : bool or dict, optional
        Find the hits of a hammer and use the good ones; those without a gap are one record.
    ambient : bool
        Whether the record is ambient: the forces, such as wind or traffic, are not measured.
    decay : bool
        Whether no force acts: each record is a free decay from its own initial state, and all have
        the same modes. For one record, the function `decay` returns more.
    without_hz : sequence of float
        Frequencies of nearby machines in an ambient record, in Hz, whose lines are excluded.
    without_harmonics : bool
        Whether to exclude the lines of the harmonics that are found in an ambient record, too.
    real_shapes : bool
        Whether to impose real shapes, unless the modes contradict them: damping is proportional, so
        that all points of a mode move in phase or in opposite phase.
    reciprocal : bool
        Whether to impose reciprocity, unless the modes contradict it: between two points with force
        and response, the response is the same in both directions.
    validate : float
        Share at the end of each record that a second fit excludes and predicts. Default: no such
        validation.
    quantity : {"displacement", "velocity", "acceleration"}, optional
        Measured quantity of the responses of tables that do not state it.
    diagrams : bool
        Whether the result contains the stabilisation diagram and the mode indicator, as
        ``diagrams``.
    settings : dict, optional
        ``settings`` of another result, instead of the options above.
    time_limit : float, optional
        Time in s after which all searches end at their best points so far; the result then says
        that it is not final. Default: a limit of the work that grows with the size of the data.
    threads : int, optional
        Number of threads. Default: one per processor.

    Returns
    -------
    Modes

    Raises
    ------
    MechidError
        If the record cannot be read, or shows no mode in the band.
    """
    tables: list[ResponseTable] = []
    is_path = [isinstance(source, str | os.PathLike) for source in sources]
    if sources and not record and all(isinstance(s, ResponseTable) or p for s, p in zip(sources, is_path)):
        tables = [one if isinstance(one, ResponseTable) else ResponseTable.read(one) for one in sources]  # type: ignore[arg-type]
    records = [] if tables else [one._inner for one in measurements(sources, "modes", record)]
    if ambient and decay:
        raise ValueError("`ambient` and `decay` exclude each other: forces act with `ambient`, but not with `decay`")
    if settings is None:
        if decay:
            test: dict[str, Any] = {"decay": {}}
        elif ambient:
            excluded = [float(hz) for hz in without_hz]
            test = {
                "ambient": {"without_hz": excluded, "without_harmonics": bool(without_harmonics)}
            }
        else:
            test = {"forced": {"hits": hits}}
        settings = {
            "test": test,
            "band_hz": None if band_hz is None else [float(hz) for hz in band_hz],
            "modes": None if modes is None else _index("modes", modes),
            "max_modes": None if max_modes is None else _index("max_modes", max_modes),
            "near_hz": [float(hz) for hz in near_hz],
            "quantity": quantity,
            "places": {
                "forces": [str(place) for place in force_at],
                "responses": [str(place) for place in response_at],
            },
            "properties": {"real_shapes": bool(real_shapes), "reciprocal": bool(reciprocal)},
            "validate": float(validate),
        }
    given = [table._inner for table in tables]
    told = json.dumps(settings, default=_plain)
    return Modes(_mechid.modes(records, given, told, bool(diagrams), time_limit, threads))


@careful
def compare_modes(first: object, second: object) -> ModeComparison:
    """Compare two sets of modes: a structure before and after a change, or a test and a model.

    Modes are paired by frequency and shape, at the points that both sets have. Each difference has
    its standard error and its p-value, the probability of at least this difference if the two
    structures are equal.

    Parameters
    ----------
    first, second : Modes, Decayed, Identified, Machine, path or mapping
        A result with modes, a file (its JSON, the description of a machine, or a universal file with
        datasets 55), or a mapping of arrays: ``natural_frequency_hz`` (modes,), ``shape`` (points, modes)
        and, if they are known, ``damping_ratio`` (modes,) and ``points``, names such as ``"12+Z"``.

    Returns
    -------
    ModeComparison

    Raises
    ------
    MechidError
        If a set has no mode with a shape, or the two have no point in common.

    Examples
    --------
    >>> import mechid
    >>> test = {"natural_frequency_hz": [10.0, 20.0], "shape": [[1.0, 1.0], [0.9, -1.0]]}
    >>> model = {"natural_frequency_hz": [10.5, 20.0], "shape": [[1.0, 1.0], [1.0, -1.0]]}
    >>> pair = mechid.compare_modes(test, model).pairs[0]
    >>> round(pair["natural_frequency_hz"]["difference"], 6), pair["mac"] > 0.99
    (0.5, True)
    """
    return ModeComparison(_mechid.compare_modes(_mode_set(first), _mode_set(second)))


def _mode_set(source: object) -> tuple[str | os.PathLike[str], str | None]:
    """Return a file, or a name and the JSON of modes."""
    if isinstance(source, str | os.PathLike):
        return source, None
    if isinstance(source, Mapping):
        frequencies = np.atleast_1d(np.asarray(source["natural_frequency_hz"], dtype=np.float64))
        shapes = np.asarray(source["shape"], dtype=np.complex128)
        if frequencies.ndim != 1 or shapes.ndim != 2 or shapes.shape[1] != len(frequencies):
            raise ValueError(
                f"`shape` has the shape {shapes.shape}, expected (points, {len(frequencies)}): one column per mode"
            )
        dampings = source.get("damping_ratio")
        modes: list[dict[str, Any]] = []
        for at, hz in enumerate(frequencies):
            shape = [{"value": [value.real, value.imag]} for value in shapes[:, at].tolist()]
            mode: dict[str, Any] = {"natural_frequency_hz": {"value": float(hz)}, "shape": shape}
            if dampings is not None:
                mode["damping_ratio"] = {"value": float(np.asarray(dampings)[at])}
            modes.append(mode)
        points = [str(point) for point in source.get("points", ())]
        return "modes", json.dumps({"modes": modes, "response_names": points})
    told = getattr(source, "to_json", None)
    if told is None:
        raise TypeError(f"modes must be a result, a path or a mapping of arrays, not {type(source).__name__}")
    return type(source).__name__, told()


def reconstruct(
    machine: Machine | Identified | IdentifiedResponses | IdentifiedElements | Modes | str | os.PathLike[str],
    *sources: object,
    method: ForceMethod = "auto",
    forced: Sequence[int] = (),
    lines: str | None = None,
    band_hz: tuple[float, float] | None = None,
    at_rest: bool = False,
    noise: Sequence[float] = (),
    rule: Literal["likelihood", "gcv", "l-curve"] = "likelihood",
    parameter: float | None = None,
    settings: dict[str, Any] | None = None,
    time_limit: float | None = None,
    threads: int | None = None,
    **record: Unpack[RecordOptions],
) -> Reconstructed:
    """Reconstruct the force that drove a known machine, or known modes, from measured responses.

    Parameters
    ----------
    machine : Machine, Identified, Modes, or path
        The machine, or the modes of a test with forces; the standard error of the force includes
        their uncertainty if they were identified. A path names a JSON file of the program.
    *sources, **record
        The record: a file, table or `Measurement` with response columns and no force. Give arrays
        by keyword: ``displacement=x, fs=…``.
    method : str
        Method, one of those of ``mechid force --method``.
    forced : sequence of int
        Numbers, from 1, of the degrees of freedom on which a force acts, or, for modes, of the
        acting forces of the modal test. Default: all.
    lines : str, optional
        Spectral lines with force.
    band_hz : (float, float), optional
        Frequencies between which the force is estimated, in Hz. Default: all, or, without a
        displacement, those at which the responses show a force.
    at_rest : bool
        Whether an open record begins at rest; with the modes of a test, whether it begins and ends
        at rest. Default: detected.
    noise : sequence of float
        Standard deviation of the noise in each measured column, in its unit. Default: estimated.
    rule, parameter : optional
        Rule for the regularisation parameter, or the parameter itself.
    settings : dict, optional
        ``settings`` of another result, instead of the options above.
    time_limit : float, optional
        Time in s after which all searches end at their best points so far; the result then says
        that it is not final. Default: a limit of the work that grows with the size of the data.
    threads : int, optional
        Number of threads. Default: one per processor.

    Returns
    -------
    Reconstructed

    Raises
    ------
    MechidError
        If the responses do not fit the machine or the method, or the method fails.
    """
    found = one(sources, "reconstruct", record)
    if lines is not None and band_hz is not None:
        raise TypeError("give either `lines` or `band_hz`, not both")
    if settings is None:
        band = None
        if band_hz is not None:
            low, high = band_hz
            band = {"low_hz": float(low), "high_hz": float(high)}
        settings = {
            "method": method,
            "forced": [_index("forced", dof) for dof in forced],
            "lines": lines,
            "band_hz": band,
            "at_rest": at_rest,
            "noise": [float(level) for level in noise],
            "rule": rule if parameter is None else {"given": float(parameter)},
        }
    inner = _mechid.reconstruct(found._inner, system_of(machine), json.dumps(settings), time_limit, threads)
    return Reconstructed(inner)


@careful
def inspect(
    path: str | os.PathLike[str],
    *,
    columns: Sequence[str] = (),
    curves: bool = False,
    fs: float | None = None,
    time: str | None = None,
    skip_lines: int = 0,
    detrend: Literal["none", "mean"] = "none",
    record_column: str | None = None,
    record_id: str | None = None,
    memory_gb: float | None = None,
    **window: Unpack[Window],
) -> Inspected:
    """Inspect a record file: format, columns, sampling, levels, strongest lines, period.

    Parameters
    ----------
    path : path
        The file.
    columns : sequence of str
        Columns to show, by name or number. Default: every column that contains only numbers.
    curves : bool
        Whether to compute the curves that `plot` and `to_svg` of the result draw.
    fs, time, skip_lines, detrend, record_column, record_id, memory_gb, **window
        As in `Measurement.open`.

    Returns
    -------
    Inspected

    Raises
    ------
    MechidError
        If the file cannot be read or has no such columns or samples.
    """
    only_window("inspect", window)
    reading = reading_of(fs, time, skip_lines, detrend, record_column, record_id, memory_gb)
    plan = json.dumps(plan_of(path, {}, reading, window))
    settings = json.dumps({"columns": list(columns), "curves": curves})
    return Inspected(_mechid.inspect(plan, settings), curves)


@careful
def sweep(
    *sources: object,
    npi: Sequence[float] | None = None,
    rate_hz: Sequence[float] | None = None,
    decimate: Sequence[float] | None = None,
    estimator: SweepEstimator = "linear",
    unknown_mass: bool = False,
    mass: float | Sequence[float | None] | None = None,
    natural_frequency_hz: float | None = None,
    reference: Machine | Identified | IdentifiedResponses | str | os.PathLike[str] | None = None,
    settings: dict[str, Any] | None = None,
    progress: Callable[[int], object] | None = None,
    threads: int | None = None,
    **record: Unpack[RecordOptions],
) -> Sweep:
    """Identify a machine at many sampling steps, and find the step that suits the estimator best.

    Parameters
    ----------
    *sources, **record
        A record, as in `identify`, or the description of an experiment (a mapping as for
        `simulate`, or the path of a JSON file), which is simulated at each setting.
    npi, rate_hz, decimate : sequence of float
        Values of the setting; give one of the three: cycles of the natural frequency in a period,
        sampling rates in Hz, or n for every n-th sample.
    estimator : str
        Estimator, one of those of ``mechid sweep --estimator``.
    unknown_mass, mass : optional
        Whether to identify the mass of a described machine, too; or known masses, as in `identify`.
    natural_frequency_hz : float, optional
        Natural frequency whose cycles `npi` counts. Default: the lowest of the machine.
    reference : Machine, Identified or path, optional
        Reference machine: the errors of a record's estimates are differences from it.
    settings : dict, optional
        ``settings`` of another result, instead of the options above.
    progress : callable, optional
        Function that is called at intervals with the number of completed settings.
    threads : int, optional
        Number of threads. Default: one per processor.

    Returns
    -------
    Sweep

    Raises
    ------
    MechidError
        If no setting gives an estimate, or the record or description cannot be read.
    """
    if settings is None:
        given = {"npi": npi, "rate_hz": rate_hz, "decimation": decimate}
        kinds = {kind: values for kind, values in given.items() if values is not None}
        if len(kinds) != 1:
            raise TypeError("one of `npi`, `rate_hz` and `decimate` is needed")
        ((kind, values),) = kinds.items()
        if unknown_mass and mass is not None:
            raise TypeError("give either `unknown_mass` or `mass`, not both")
        settings = {
            "kind": kind,
            "settings": [float(value) for value in values],
            "estimator": estimator,
            "mass": None if mass is None and not unknown_mass else _mass(mass),
            "natural_frequency_hz": natural_frequency_hz,
        }
    described = description_of(sources[0]) if len(sources) == 1 else None
    if described is None:
        inner = one(sources, "sweep", record)._inner
        compared = None if reference is None else machine_of(reference)._inner
    else:
        for name in (*record, *(["reference"] if reference is not None else [])):
            raise TypeError(f"`{name}` belongs to a record; the description of the experiment states this itself")
        inner, compared = None, None
    found = _mechid.sweep(
        inner, described, json.dumps(settings), compared, progress, threads
    )
    return Sweep(found)


@careful
def simulate(
    experiment: Mapping[str, Any] | str | os.PathLike[str], *, memory_gb: float | None = None
) -> Simulation:
    """Simulate a described experiment: the record that it would give.

    Parameters
    ----------
    experiment : mapping or path
        ``system``, ``sampling``, ``excitation``, ``scheme``, ``response``, ``periods`` and
        ``noise``, as in the JSON for ``mechid simulate``, or the path of such a file. The matrices
        of a ``system`` may be NumPy arrays, or sparse matrices of SciPy; with more than 64 degrees
        of freedom the record has only the columns that ``outputs`` and ``excitation`` name.
    memory_gb : float, optional
        Maximum memory of the simulation, in GB. Default: 1.07.

    Returns
    -------
    Simulation

    Raises
    ------
    MechidError
        If the description is wrong, or the response does not exist.
    """
    described = description_of(experiment)
    if described is None:
        raise TypeError("an experiment must be a mapping, or the path of a .json file")
    return Simulation(_mechid.simulate(*described, memory_gb))


@careful
def selected_modes(
    mass: Any,
    damping: Any,
    stiffness: Any,
    count: int,
    *,
    near_hz: float | None = None,
) -> SelectedModes:
    """Find some modes of a machine of any size: the lowest, or those nearest to a frequency.

    For a machine of a few degrees of freedom, `Machine.modes` has all of them. Each mode is exact
    to rounding; it is likely, but not proved, that no mode between them is missed.

    Parameters
    ----------
    mass, damping, stiffness : array or sparse matrix
        M, C and K in kg, N·s/m and N/m, n × n: SciPy's sparse matrices and arrays, NumPy arrays or
        lists of rows. They need not be symmetric.
    count : int
        Number of modes.
    near_hz : float, optional
        Frequency whose nearest modes are computed, in Hz. Default: the lowest modes.

    Returns
    -------
    SelectedModes

    Raises
    ------
    MechidError
        If the matrices do not form a machine, or the search finds too few modes.
    """
    if count < 1:
        raise ValueError(f"`count` must be at least 1, got {count}")
    if near_hz is not None and not 0 < near_hz < float("inf"):
        raise ValueError(f"`near_hz` must be positive, got {near_hz}")
    matrices = {"mass": mass, "damping": damping, "stiffness": stiffness}
    described = json.dumps({"system": matrices}, default=listed)
    return SelectedModes(_mechid.selected_modes(described, count, near_hz))


@careful
def integrate(
    machine: Machine | Identified | IdentifiedResponses,
    force: ArrayLike,
    fs: float,
    *,
    scheme: Scheme | Mapping[str, Any] = "newmark",
    response: Literal["from-rest", "periodic"] = "from-rest",
    displacement: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    allow_unstable: bool = False,
) -> Mapping[str, NDArray[np.float64]]:
    """Integrate the equation of motion under a sampled force, by a time-stepping scheme.

    Parameters
    ----------
    machine : Machine or Identified
        M, C and K.
    force : array_like
        Shape (samples,) or (samples, degrees of freedom), in N.
    fs : float
        Sampling rate, in Hz.
    scheme : str or mapping
        ``"newmark"``, ``"central-difference"``, ``"houbolt"``, ``"wilson-theta"``,
        ``"generalised-alpha"``, ``"hht-alpha"``, ``"wbz-alpha"``, ``"bathe"``,
        ``"rho-infinity-bathe"``, ``"matrix-exponential"`` and ``"runge-kutta-4"`` (the force linear
        between samples), ``"exact"`` (periodic responses), or a mapping of its ``name`` and
        parameters, as in the JSON of an experiment.
    response : {"from-rest", "periodic"}
        Whether the motion begins at the first sample, or repeats with the force.
    displacement, velocity : array_like, optional
        Motion at the first sample, in m and m/s. Default: zero.
    allow_unstable : bool
        Whether to allow steps at which the free motion grows numerically.

    Returns
    -------
    mapping
        ``"displacement"``, ``"velocity"``, ``"acceleration"``, each (samples, degrees of freedom), in
        m, m/s and m/s².

    Raises
    ------
    MechidError
        If the scheme does not apply, or the force does not fit the machine.
    """
    start = {"displacement": displacement, "velocity": velocity}
    given = {name: _vector(name, values) for name, values in start.items() if values is not None}
    if given and response == "periodic":
        raise TypeError("a periodic response has no initial state: leave `displacement` and `velocity` out")
    known = machine_of(machine)
    forces = matrix("force", force)
    named: dict[str, Any] = {"name": scheme} if isinstance(scheme, str) else dict(scheme)
    if named.get("name") in ("matrix-exponential", "runge-kutta-4"):
        named.setdefault("load", "linear")
    rows = {
        name: getattr(known, name).tolist() for name in ("mass", "damping", "stiffness")
    }
    described = {
        "system": rows,
        "sampling": {"samples": len(forces), "rate_hz": float(fs)},
        "excitation": [],
        "scheme": named,
        "response": {"from": given} if given else response,
        "allow_unstable": allow_unstable,
    }
    return ReadOnly(dict(_mechid.integrate(json.dumps(described), forces, float(fs))))


@careful
def predict(
    machine: Machine | Identified | IdentifiedResponses,
    force: ArrayLike,
    fs: float,
    *,
    between_samples: Literal["held", "linear", "euler"] = "linear",
    extent: Literal["open", "period"] = "open",
    displacement: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
) -> Mapping[str, NDArray[np.float64]]:
    """Compute the exact response to a force that is held or linear between its samples.

    Parameters
    ----------
    machine : Machine or Identified
        M, C and K.
    force : array_like
        Shape (samples,) or (samples, degrees of freedom), in N.
    fs : float
        Sampling rate, in Hz.
    between_samples : {"held", "linear", "euler"}
        Assumption on the force between samples.
    extent : {"open", "period"}
        Whether the motion begins at the first sample, or repeats with the force.
    displacement, velocity : array_like, optional
        Motion at the first sample, in m and m/s. Default: zero.

    Returns
    -------
    mapping
        ``"displacement"``, ``"velocity"``, ``"acceleration"``, each (samples, degrees of freedom), in
        m, m/s and m/s².

    Raises
    ------
    MechidError
        If the force does not fit the machine, or the response overflows.
    """
    known = machine_of(machine)
    start = None
    if displacement is not None or velocity is not None:
        zero = [0.0] * len(known.mass)
        start = tuple(
            np.array(_vector(name, zero if values is None else values), dtype=np.float64)
            for name, values in (("displacement", displacement), ("velocity", velocity))
        )
    found = _mechid.predict(
        known._inner,
        matrix("force", force),
        float(fs),
        json.dumps(between_samples),
        json.dumps(extent),
        start,  # type: ignore[arg-type]
    )
    return ReadOnly(dict(found))


@careful
def multisine(
    samples: int,
    fs: float,
    *,
    lines: str = "all",
    phases: Literal["schroeder", "schroeder-binary", "random", "zero", "low-crest"] = "schroeder",
    amplitude: float | None = None,
    rms: float | None = None,
    peak: float | None = None,
    seed: int = 0,
    starts: int = 16,
) -> Multisine:
    """Make one period of a multisine, a sum of cosines on chosen lines of the period.

    Parameters
    ----------
    samples : int
        Number of samples in the period.
    fs : float
        Sampling rate, in Hz.
    lines : str
        ``"all"``, ``"odd"``, ``"even"``, or numbers and ranges such as ``"1:2:801"``.
    phases : str
        Rule for the phases, one of those of ``mechid multisine --phases``.
    amplitude, rms, peak : float, optional
        Level, as one of these: amplitude of every line (default: 1), RMS value, or peak including
        values between samples, in N.
    seed, starts : int
        Seed of random phases, and number of starting points of the search for a low crest factor.

    Returns
    -------
    Multisine

    Raises
    ------
    MechidError
        If a line is outside of the period, or a level is not positive.
    """
    levels = {"amplitude": amplitude, "rms": rms, "peak": peak}
    given = [(name, float(level)) for name, level in levels.items() if level is not None]
    if len(given) > 1:
        raise TypeError(f"give either `{given[0][0]}` or `{given[1][0]}`, not both")
    laws = ("schroeder", "schroeder-binary", "random", "zero", "low-crest")
    if phases not in laws:
        raise ValueError(f"`phases` must be one of {', '.join(laws)}, got {phases!r}")
    search = starts if phases == "low-crest" else 0
    law = "schroeder" if phases == "low-crest" else phases
    found = _mechid.multisine(
        _index("samples", samples), float(fs), lines, law, (search, seed),
        given[0] if given else ("amplitude", 1.0),
    )
    return Multisine._of(float(fs), found)


def _given(**keywords: Any) -> dict[str, Any]:
    """Return the keywords that were given."""
    return {name: value for name, value in keywords.items() if value is not None and value is not False and value != ()}


def _plain(value: Any) -> Any:
    """Return the content of NumPy objects and mappings in the form of JSON."""
    if isinstance(value, Mapping):
        return dict(value)
    return np.asarray(value).tolist()


def _levels(force_noise: float | Sequence[float] | None) -> tuple[float, ...] | None:
    """Return the noise levels of the forces in their saved form."""
    if force_noise is None:
        return None
    levels = force_noise if isinstance(force_noise, Iterable) else [force_noise]
    return tuple(float(level) for level in levels)


def _without(lines: str | None, hz: Sequence[float | Mapping[str, Any]]) -> str:
    """Return the excluded lines as JSON."""
    frequencies = [dict(one) if isinstance(one, Mapping) else {"frequency_hz": float(one)} for one in hz]
    return json.dumps({"lines": lines, "frequencies": frequencies})


def _lines(lines: str | None, band_hz: tuple[float, float] | None) -> Any:
    if lines is not None and band_hz is not None:
        raise TypeError("give either `lines` or `band_hz`, not both")
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


def _structure(structure: str | Sequence[str]) -> list[str]:
    forms = [structure] if isinstance(structure, str) else structure
    return [word for form in forms for word in str(form).split()]


def _vector(name: str, values: ArrayLike) -> list[float]:
    given = np.atleast_1d(np.asarray(values))
    if given.ndim != 1 or given.dtype.kind not in "fiu":
        raise TypeError(f"`{name}` must be a number, or one number for each degree of freedom")
    return [float(value) for value in given]

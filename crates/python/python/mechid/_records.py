"""Records: files, arrays and tables as measurements."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import (
    TYPE_CHECKING,
    Any,
    Literal,
    Protocol,
    TypeAlias,
    TypedDict,
    TypeVar,
    Unpack,
    final,
    runtime_checkable,
)

import numpy as np

from . import _mechid
from ._errors import MechidError, careful
from ._mapping import ReadOnly

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@runtime_checkable
class Table(Protocol):
    """Columns by name: a data frame, an xarray dataset, or a mapping of arrays."""

    def __getitem__(self, name: str, /) -> ArrayLike: ...
    def keys(self) -> object: ...


Names: TypeAlias = str | Sequence[str]
"""Columns, one per degree of freedom: names separated by commas, or a sequence of names."""

_KINDS = ("force", "displacement", "velocity", "acceleration")
_OF_TABLES = ("time", "unit", "scale")
_OF_FILES = ("skip_lines", "detrend", "record_column", "record_id", "memory_gb")
_IN_BRACKETS = re.compile(r"[\[({<]([^\])}>]+)[\])}>]")
# Digits after the ninth, which dates in nanoseconds cannot have, are not part of the clock.
_ISO_INSTANT = re.compile(
    r"(?P<date>\d{4}-\d\d-\d\d)[Tt ](?P<clock>\d\d:\d\d(:\d\d([.,]\d{1,9})?)?)\d*"
    r"\s*([Zz]|UTC|(?P<sign>[+-])(?P<hours>\d\d):?(?P<minutes>\d\d)?)?"
)
_NAME_BYTES = 4096
"""Maximum length of the name of a column or record, in bytes."""


class Window(TypedDict, total=False):
    """Samples of a record to use.

    ``start`` is the first sample, counted from 1; ``period`` the number of samples in one period
    (default: all samples from ``start`` on are one window); ``periods`` the number of whole periods
    (default: as many as there are).
    """

    start: int
    period: int | None
    periods: int | None


class RecordOptions(Window, total=False):
    """Columns of a record, and the samples of it to use.

    ``force``, ``displacement``, ``velocity`` and ``acceleration`` are columns of a file or table,
    or arrays of shape (samples,) or (samples, degrees of freedom) in N, m, m/s and m/s². ``fs`` is
    the sampling rate in Hz; it is needed for arrays, and for tables without a column or an index of
    time.

    For files and tables: ``time`` names the time column, ``unit`` states units of columns
    (``{"acc": "g"}``) and ``scale`` factors that convert columns to SI units; both have priority
    over the names of the columns.

    For files: ``skip_lines`` is the number of header lines to skip, ``detrend="mean"`` subtracts
    the mean of every channel, ``record_column`` is the column that names the records of a Parquet
    file, ``record_id`` the record to read, by its name in this column, and ``memory_gb`` the
    maximum memory, in GB, for the numbers and the work on them.
    """

    force: Names | ArrayLike
    displacement: Names | ArrayLike
    velocity: Names | ArrayLike
    acceleration: Names | ArrayLike
    fs: float | None
    time: str | None
    skip_lines: int
    detrend: Literal["none", "mean"]
    record_column: str | None
    record_id: str | None
    memory_gb: float | None
    unit: Mapping[str, str]
    scale: Mapping[str, float]


@final
class Measurement:
    """Forces and responses of a machine, and the window of them to use.

    Create one with `open`, `from_arrays` or `from_table`. It never changes, and a long text file is
    not held in memory.
    """

    __slots__ = ("_inner",)

    def __init__(self, inner: _mechid.Measurement) -> None:
        self._inner = inner

    @classmethod
    @careful
    def open(
        cls,
        path: str | os.PathLike[str],
        *,
        force: Names = (),
        displacement: Names = (),
        velocity: Names = (),
        acceleration: Names = (),
        fs: float | None = None,
        time: str | None = None,
        skip_lines: int = 0,
        detrend: Literal["none", "mean"] = "none",
        record_column: str | None = None,
        record_id: str | None = None,
        memory_gb: float | None = None,
        unit: Mapping[str, str] | None = None,
        scale: Mapping[str, float] | None = None,
        **window: Unpack[Window],
    ) -> Measurement:
        """Open a record file: text, MATLAB, HDF5 or universal file, also compressed with gzip.

        Parameters
        ----------
        path : path
            The file.
        force, displacement, velocity, acceleration : str or sequence of str
            Columns, by name or number counted from 1, one per degree of freedom; ``"0"`` if no
            force acts. Columns are converted to SI units if their names state other units.
        fs : float, optional
            Sampling rate in Hz, if there is no time column.
        time : str, optional
            The time column; its rate must not contradict `fs`.
        skip_lines : int
            Number of header lines to skip above the table.
        detrend : {"none", "mean"}
            Constant to subtract from every channel.
        record_column : str, optional
            Column that names the record of each row, if a Parquet file holds many records.
        record_id : str, optional
            Record to read from a file of many records, by its name in `record_column`. Default: the
            only one.
        memory_gb : float, optional
            Maximum memory for the numbers and the work on them, in GB. Default: 0.27 GB plus 512
            bytes per byte of the file, at most 8.6 GB.
        unit : mapping of str to str, optional
            Units of columns, with priority over their names: ``{"acc": "g", "time": "ms"}``.
        scale : mapping of str to float, optional
            Factors that convert columns to SI units, such as those of sensors: ``{"force":
            0.0893}``.
        **window
            ``start``, ``period`` and ``periods``, as in `window`.

        Raises
        ------
        MechidError
            If the file cannot be read or has no such columns or samples.
        """
        only_window("Measurement.open", window)
        columns = dict(zip(_KINDS, (force, displacement, velocity, acceleration), strict=True))
        channels = {kind: _names(kind, given) for kind, given in columns.items()}
        reading = reading_of(
            fs, time, skip_lines, detrend, record_column, record_id, memory_gb, unit, scale
        )
        plan = plan_of(path, channels, reading, window)
        return cls(_mechid.Measurement.open(json.dumps(plan)))

    @classmethod
    @careful
    def from_arrays(
        cls,
        force: ArrayLike | None = None,
        displacement: ArrayLike | None = None,
        *,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        fs: float,
        name: str = "the record",
        **window: Unpack[Window],
    ) -> Measurement:
        """Create a measurement from copies of arrays.

        Parameters
        ----------
        force, displacement, velocity, acceleration : array_like of real numbers
            Shape (samples,) or (samples, degrees of freedom), in N, m, m/s and m/s². A series whose name
            (``"x [mm]"``) or ``attrs`` state another unit is converted.
        fs : float
            Sampling rate, in Hz.
        name : str
            Name of the record in messages and results.
        **window
            ``start``, ``period`` and ``periods``, as in `window`.

        Raises
        ------
        TypeError
            If an array holds other than real numbers.
        MechidError
            If arrays differ in length, contain NaN or infinity, or are shorter than the window.
        """
        only_window("Measurement.from_arrays", window)
        columns: list[NDArray[np.float64]] = []
        counts: list[int] = []
        arrays = (force, displacement, velocity, acceleration)
        _same_labels(zip(_KINDS, arrays, strict=True))
        for kind, given in zip(_KINDS, arrays, strict=True):
            found = [] if given is None else _columns(kind, given)
            counts.append(len(found))
            columns += found
        names, channels = _named(tuple(counts))
        units = [_series_unit(kind, given) for kind, given in zip(_KINDS, arrays, strict=True)]
        if any(units):
            names, channels = _with_units(names, units, channels)
        return cls._of(name, fs, list(zip(names, columns, strict=True)), channels, window)

    @classmethod
    @careful
    def from_table(
        cls,
        table: Table | Sequence[Mapping[str, object]],
        *,
        force: Names = (),
        displacement: Names = (),
        velocity: Names = (),
        acceleration: Names = (),
        fs: float | None = None,
        time: str | None = None,
        unit: Mapping[str, str] | None = None,
        scale: Mapping[str, float] | None = None,
        name: str = "the record",
        **window: Unpack[Window],
    ) -> Measurement:
        """Create a measurement from a data frame, an xarray dataset, a mapping, or SEP 5 channels.

        Parameters
        ----------
        table : mapping of names to columns, or SEP 5 dictionaries
            Columns are converted to N, m, m/s and m/s² if another unit is stated: in the name, such
            as ``"x [um]"``, in the ``units`` among the ``attrs``, or in the ``unit_str`` of a SEP 5
            channel. The channels of SEP 5 are a sequence, one dictionary, or the ``channels`` of an
            object.
        force, displacement, velocity, acceleration : str or sequence of str
            Names of columns, with their units or without, one per degree of freedom; ``"0"`` if no
            force acts.
        fs : float, optional
            Sampling rate, in Hz; it must not contradict `time` or SEP 5 channels. Default: that of
            the time column, of the index or of SEP 5 channels (``fs`` or ``time``). The index is
            time if it contains dates, is called time or has a unit of time. An index of
            floating-point numbers without a name is time in s, unless all its steps are 1.
        time : str, optional
            The time column, or the name of the index.
        unit : mapping of str to str, optional
            Units of columns, with priority over their names: ``{"acc": "g"}``.
        scale : mapping of str to float, optional
            Factors that convert columns to SI units, such as those of sensors.
        name : str
            Name of the record in messages and results.
        **window
            ``start``, ``period`` and ``periods``, as in `window`.

        Raises
        ------
        MechidError
            If there is no such column, or as `from_arrays`.
        """
        only_window("Measurement.from_table", window)
        channels: dict[str, list[str]] = {}
        columns: list[tuple[str, NDArray[np.float64]]] = []
        given = dict(zip(_KINDS, (force, displacement, velocity, acceleration), strict=True))
        source: _Sep5 | _Frame
        channels_of_table = _sep5_channels(table)
        if channels_of_table is None:
            source = _Frame(table, unit, scale)  # type: ignore[arg-type]
        else:
            source = _Sep5(channels_of_table, unit, scale)
        used = [name for kind, names in given.items() for name in _names(kind, names) if name != "0"]
        if isinstance(source, _Sep5):
            source.check_starts(used)
        else:
            _same_labels((name, source[name]) for name in used)
        for kind, names in given.items():
            channels[kind] = []
            for column in _names(kind, names):
                label = column
                if column != "0":
                    label, factor = source.label(column, kind)
                    found = _columns(column, source[column])
                    if len(found) != 1:
                        raise ValueError(f"column {column!r} consists of {len(found)} columns")
                    columns.append((label, found[0] * factor if factor != 1.0 else found[0]))
                channels[kind].append(label)
        rate = fs
        if fs is None or time is not None or isinstance(source, _Sep5):
            stated = source.fs(given, _text("time", time))
            rate = stated if fs is None else _same_rate(stated, fs)
        if rate is None:
            raise TypeError(
                "a table needs its sampling rate: give `fs`, in Hz, or a column or an index of time (`time`)"
            )
        return cls._of(name, rate, columns, json.dumps(channels), window)

    @classmethod
    def _of(
        cls,
        name: str,
        fs: float,
        columns: list[tuple[str, NDArray[np.float64]]],
        channels: str,
        window: Window,
    ) -> Measurement:
        rate = _rate(fs)
        if rate is None:
            raise TypeError("arrays need their sampling rate: give `fs`, in Hz")
        for label in (name, *(column for column, _ in columns)):
            if len(label.encode(errors="replace")) > _NAME_BYTES:
                raise ValueError(f"a name is longer than {_NAME_BYTES} bytes: {label[:40]!r}…")
        return cls(
            _mechid.Measurement.from_columns(name, rate, columns, channels, _window_json(window))
        )

    @careful
    def window(self, **window: Unpack[Window]) -> Measurement:
        """Return another window of the same record.

        Parameters
        ----------
        start : int
            First sample, counted from 1.
        period : int, optional
            Number of samples in one period. Default: all samples from ``start`` on are one window.
        periods : int, optional
            Number of whole periods. Default: as many as there are.

        Raises
        ------
        MechidError
            If the record does not contain all of these samples.
        """
        only_window("Measurement.window", window)
        return Measurement(self._inner.window(_window_json(window)))

    @property
    def name(self) -> str:
        """Name in messages: the file name as the caller wrote it."""
        return self._inner.name

    @property
    def fs(self) -> float:
        """Sampling rate, in Hz."""
        return self._inner.fs

    @property
    def samples(self) -> int:
        """Number of samples of the whole record."""
        return self._inner.samples

    @property
    def channels(self) -> Mapping[str, Sequence[str]]:
        """Columns of each quantity."""
        return ReadOnly(json.loads(self._inner.channels))

    @property
    def plan(self) -> dict[str, object] | None:
        """Settings that open the same record again; None for arrays."""
        plan = self._inner.plan
        return None if plan is None else json.loads(plan)

    @property
    def force(self) -> NDArray[np.float64]:
        """Force of the window, shape (samples, degrees of freedom), in N."""
        return self._inner.force()

    @property
    def responses(self) -> Mapping[str, NDArray[np.float64]]:
        """Responses of the window by quantity, each (samples, degrees of freedom), in SI units."""
        return ReadOnly(dict(self._inner.responses()))

    def __copy__(self) -> Measurement:
        return self

    def __deepcopy__(self, memo: object) -> Measurement:
        return self

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        plan = self.plan
        if plan is not None:
            return _opened, (json.dumps(plan),)
        used = {"force": self.force, **self.responses}
        arrays = {kind: values for kind, values in used.items() if values.shape[1]}
        window = json.loads(self._inner.window_settings)
        kept = {name: window[name] for name in ("period", "periods") if window.get(name) is not None}
        return _copied, (arrays, self.fs, self.name, kept)

    def __len__(self) -> int:
        return self.samples

    def __repr__(self) -> str:
        return f"<Measurement {self.name!r}: {self.samples} samples at {self.fs:g} Hz>"


def _opened(plan: str) -> Measurement:
    return Measurement(_mechid.Measurement.open(plan))


def _copied(arrays: Mapping[str, Any], fs: float, name: str, window: Window) -> Measurement:
    return Measurement.from_arrays(**arrays, fs=fs, name=name, **window)


class _Sep5:
    """Channels in the form of the SDyPy enhancement proposal 5."""

    def __init__(
        self,
        channels: Sequence[Mapping[str, object]],
        unit: Mapping[str, str] | None,
        scale: Mapping[str, float] | None,
    ) -> None:
        for number, channel in enumerate(channels, 1):
            for field in ("name", "data"):
                if field not in channel:
                    raise TypeError(f"channel {number} has no {field!r}, which SEP 5 channels have")
        self._channels = {str(channel["name"]): channel for channel in channels}
        if len(self._channels) < len(channels):
            raise ValueError("several channels have the same name")
        self._unit = {self._find(name): text for name, text in _units(unit).items()}
        self._scale = {self._find(name): factor for name, factor in _scales(scale).items()}

    def _find(self, wanted: str) -> str:
        if wanted in self._channels:
            return wanted
        names = list(self._channels)
        at = None if wanted.isdigit() else _mechid.find_column(names, wanted)
        if at is None:
            raise no_column(wanted, names)
        return names[at]

    def __getitem__(self, wanted: str) -> ArrayLike:
        values: ArrayLike = self._channels[self._find(wanted)]["data"]  # type: ignore[assignment]
        return values

    def label(self, wanted: str, kind: str) -> tuple[str, float]:
        """Return the name of a channel with its unit, and a factor for its numbers."""
        name = self._find(wanted)
        if name in self._scale:
            return f"[{_SI[kind]}] {name}", self._scale[name]
        if name in self._unit:
            return f"[{self._unit[name]}] {name}", 1.0
        unit = self._channels[name].get("unit_str")
        if unit:
            _only_one_unit(name, str(unit), kind, "`unit_str`")
        return (f"{name} [{unit}]" if unit else name), 1.0

    def check_starts(self, names: Sequence[str]) -> None:
        """Refuse channels that begin at different instants, according to any field that states
        it."""
        used = {name: self._channels[self._find(name)] for name in names}
        for field in ("start_timestamp", "start_time", "timestamp", "time"):
            starts = {name: _start(channel.get(field)) for name, channel in used.items()}
            if len(set(starts.values())) > 1:
                told = ", ".join(f"{name!r}: {start}" for name, start in starts.items())
                raise ValueError(
                    f"the channels begin at different instants ({field}: {told}): cut them so that they begin together"
                )

    def fs(self, given: Mapping[str, Names], time: str | None) -> float | None:
        names = [name for kind, names in given.items() for name in _names(kind, names)]
        used = [self._channels[self._find(name)] for name in names if name != "0"]
        rates: list[float] = [_number("fs", c["fs"]) for c in used if c.get("fs") is not None]
        rates = sorted(set(rates))
        of_times = [_rate_of(time, self[time])] if time is not None else []
        of_times += [
            _rate_of("time", c["time"])
            for c in used
            if c.get("time") is not None and np.ndim(c["time"]) == 1  # type: ignore[arg-type]
        ]
        # Instants with few digits give a slightly different rate.
        for rate in of_times:
            if not any(_are_same(known, rate) for known in rates):
                rates.append(rate)
        if len(rates) > 1:
            raise ValueError(f"the channels have several sampling rates: {sorted(rates)} Hz")
        if not used:
            raise TypeError("no column of the channels is named")
        return rates.pop() if rates else None


def _sep5_channels(table: object) -> Sequence[Mapping[str, object]] | None:
    """Return the channels of a table in the form of SEP 5: a sequence of channels, one channel
    alone, or an object with ``channels``; None for another table."""
    if isinstance(table, Mapping):
        is_channel = isinstance(table.get("name"), str) and "data" in table
        inner = table.get("channels")
    else:
        is_channel, inner = False, getattr(table, "channels", None)
    if is_channel:
        return [table]  # type: ignore[list-item]
    if _are_channels(inner):
        return inner
    if isinstance(table, Sequence):
        for number, channel in enumerate(table, 1):
            if not isinstance(channel, Mapping):
                raise TypeError(f"channel {number} is a {type(channel).__name__}, not a mapping of SEP 5")
        return table
    return None


def _are_channels(given: object) -> bool:
    is_list = isinstance(given, Sequence) and not isinstance(given, str)
    return is_list and bool(given) and all(isinstance(channel, Mapping) for channel in given)  # type: ignore[attr-defined]


_SAME_RATE = 1e-4
"""Maximum relative difference of equal sampling rates, because instants have few digits."""


def _are_same(first: float, second: float) -> bool:
    return math.isclose(first, second, rel_tol=_SAME_RATE)


def _same_rate(stated: float | None, fs: float) -> float:
    """Return the sampling rate `fs`, in Hz, unless a table states another one."""
    given = _number("fs", fs)
    if stated is not None and not _are_same(stated, given):
        raise ValueError(
            f"the sampling rate of the table is {stated:.8g} Hz, and `fs` is {given:.8g} Hz: leave `fs` out, or "
            "correct one of them"
        )
    return given


def _start(value: object) -> str | None:
    """Return the first of some instants, or the only one, as text; None if it is not known."""
    if value is None:
        return None
    first = np.asarray(value).ravel()[:1]
    return str(first[0]) if len(first) else None


def _same_labels(arrays: Iterable[tuple[str, object]]) -> None:
    """Refuse columns with different labels: equal positions do not mean the same sample then."""
    known: tuple[str, Any] | None = None
    for name, values in arrays:
        labels = _labels(values)
        if labels is None:
            continue
        if known is None:
            known = name, labels
        elif len(labels) != len(known[1]) or not labels.equals(known[1]):
            raise ValueError(
                f"{known[0]!r} and {name!r} have different indexes: align them first, or give their values "
                "(`.to_numpy()`) if they go together by position"
            )


def _labels(values: object) -> Any:
    """Return the labels of the samples: the index of pandas or xarray; None without labels."""
    index = getattr(values, "index", None)
    if index is not None and hasattr(index, "equals"):
        return index
    indexes, dims = getattr(values, "indexes", None), getattr(values, "dims", None)
    if isinstance(indexes, Mapping) and isinstance(dims, tuple) and dims:
        return indexes.get(dims[0])
    return None


_SI = {"force": "N", "displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}


class _Frame:
    """A data frame, an xarray dataset or a mapping of arrays."""

    def __init__(
        self, table: Table, unit: Mapping[str, str] | None, scale: Mapping[str, float] | None
    ) -> None:
        self._table = table
        # The name of each column in messages, and the key that finds it.
        self._names = {str(name): name for name in table.keys()}  # type: ignore[attr-defined]
        # A dataset of xarray may have a variable of this name.
        self._index: Any = getattr(table, "index", None) if hasattr(table, "columns") else None
        named = getattr(self._index, "name", None)
        self._index_name = None if named is None else str(named)
        self._unit = {self._find(name): text for name, text in _units(unit).items()}
        self._scale = {self._find(name): factor for name, factor in _scales(scale).items()}

    def _find(self, wanted: str) -> str:
        if wanted in self._names:
            return wanted
        names = list(self._names)
        at = None if wanted.isdigit() else _mechid.find_column(names, wanted)
        if at is None and wanted == self._index_name:
            return wanted
        if at is None:
            try:
                # The table may have columns that its keys do not list, such as a coordinate.
                self._table[wanted]
            except Exception:
                raise no_column(wanted, names) from None
            return wanted
        return names[at]

    def __getitem__(self, wanted: str) -> ArrayLike:
        name = self._find(wanted)
        if name not in self._names and name == self._index_name:
            values: ArrayLike = self._index
            return values
        return self._table[self._names.get(name, name)]

    def label(self, wanted: str, kind: str) -> tuple[str, float]:
        """Return the name of a column with its unit, and a factor for its numbers."""
        name = self._find(wanted)
        if name in self._scale:
            return f"[{_SI[kind]}] {name}", self._scale[name]
        if name in self._unit:
            return f"[{self._unit[name]}] {name}", 1.0
        unit = self._stated(name)
        if unit:
            _only_one_unit(name, unit, kind, "`attrs`")
        return (f"{name} [{unit}]" if unit else name), 1.0

    def _stated(self, name: str) -> str | None:
        """Return the unit among the attributes of a column or of the table."""
        own = getattr(self[name], "attrs", None)
        shared = getattr(self._table, "attrs", None)
        units = shared.get("units") if isinstance(shared, Mapping) else None
        if isinstance(units, Mapping) and name in units:
            return str(units[name])
        # A column of a data frame has the attributes of the whole frame.
        stated = own.get("units", own.get("unit")) if isinstance(own, Mapping) else None
        return stated if isinstance(stated, str) else None

    def fs(self, given: Mapping[str, Names], time: str | None) -> float | None:
        """Return the sampling rate from a time column, or from the index or coordinate of time."""
        if time is not None:
            return self._rate(self._find(time))
        coords = getattr(self._table, "coords", None)
        for names in (self._names, coords or ()):
            listed = [str(name) for name in names]
            at = _mechid.time_column(listed)
            if at is not None:
                return self._rate(listed[at])
        shared = getattr(self._table, "attrs", None)
        if isinstance(shared, Mapping):
            for key in ("fs", "sample_rate", "sampling_rate", "sample_rate_hz"):
                if isinstance(shared.get(key), (int, float)):
                    return float(shared[key])
        return None if self._index is None else self._rate_of_index(self._index)

    def _rate_of_index(self, index: Any) -> float | None:
        """Return the sampling rate from an index of time; None if the index counts the samples."""
        instants, name = _instants(index), self._index_name
        if instants.dtype.kind in "mM":
            return _rate_of("time", instants)
        if instants.dtype.kind not in "fiuO":
            return None
        if name is None:
            # Steps of exactly 1 are positions of samples, also after a part of the rows was chosen.
            is_time = instants.dtype.kind == "f" and bool((np.diff(instants) != 1).any())
            return _rate_of("time", instants) if is_time else None
        unit = "s" if name in self._scale else self._unit.get(name) or self._stated(name)
        if _mechid.time_column([name]) is not None or _has_unit_of_time(name, unit):
            return self._rate(name)
        raise TypeError(
            f"the index {name!r} is not called time and has no unit of time, so it gives no sampling rate: "
            f"give `fs`, in Hz, or a time column (`time`; `time={name!r}` if the index is time in s)"
        )

    def _rate(self, name: str) -> float:
        if name in self._scale:
            return _rate_of("time [s]", np.asarray(self[name]) * self._scale[name])
        unit = self._unit.get(name)
        if unit is None:
            unit = self._stated(name)
            if unit:
                _only_one_unit(name, unit, "time", "`attrs`")
        return _rate_of(f"[{unit}] {name}" if unit else name, self[name])


def _only_one_unit(name: str, unit: str, kind: str, source: str) -> None:
    """Refuse a column whose name states another unit than its source, such as its attributes."""
    # A unit in brackets counts before one in words, and the first one in brackets before the others.
    first, last, alone = (_factor(label, kind) for label in (f"[{unit}] {name}", f"{name} [{unit}]", name))
    # A name with a unit is refused as a column of another quantity.
    is_stated = alone != 1.0 or _factor(name, "velocity" if kind == "force" else "force") is None
    if _differ(first, last) or (is_stated and _differ(alone, last)):
        raise ValueError(
            f"column {name!r} states one unit in its name and another, {unit!r}, in its {source}: correct one "
            "of them, or state the unit in the call (`unit`)"
        )


def _differ(first: float | None, second: float | None) -> bool:
    if first is None or second is None:
        return first is not second
    return not math.isclose(first, second, rel_tol=1e-9)


@lru_cache(maxsize=64)
def _factor(label: str, kind: str) -> float | None:
    """Return the factor that converts a column to SI units; None if it has a unit of another
    quantity."""
    ones = np.ones(2)
    other = "displacement" if kind == "force" else "force"
    channels = {**dict.fromkeys(_KINDS, ()), kind: (label,), other: ("-",)}
    try:
        if kind == "time":
            return 1 / _mechid.rate_of(label, np.arange(4.0))
        record = _mechid.Measurement.from_columns(
            "units", 1.0, [(label, ones), ("-", ones)], json.dumps(channels), _window_json({})
        )
    except MechidError:
        return None
    values = record.force() if kind == "force" else dict(record.responses())[kind]
    return float(values[0, 0])


def _has_unit_of_time(name: str, unit: str | None) -> bool:
    """Return whether a unit, or else the texts in brackets of a name, is a unit of time."""
    units = [unit] if unit else _IN_BRACKETS.findall(name)
    return any(_mechid.time_column([f"time [{text}]"]) is not None for text in units)


def _instants(values: object) -> NDArray[Any]:
    """Return instants as an array: texts become dates, and dates with a time zone are converted to
    UTC."""
    array = np.asarray(values)
    if array.dtype.kind == "O":
        # A series has a method `tz_convert`, too, which converts its index.
        dates = getattr(values, "dt", None if hasattr(values, "index") else values)
        convert = getattr(dates, "tz_convert", None)
        if convert is not None:
            return np.asarray(convert(None))
    is_text = array.dtype.kind in "UT" or (array.dtype.kind == "O" and isinstance(next(array.flat, None), str))
    return _dates_of_text(array.tolist()) if is_text and array.ndim == 1 else array


def _dates_of_text(texts: list[object]) -> NDArray[np.datetime64]:
    """Return instants in the form of ISO 8601 as dates, in UTC if they state their time zones."""
    clocks: list[str] = []
    zones: list[int] = []
    for row, text in enumerate(texts, 1):
        parts = _ISO_INSTANT.fullmatch(text.strip()) if isinstance(text, str) else None
        if parts is None:
            raise _not_iso(row, text)
        sign, hours, minutes = parts["sign"], int(parts["hours"] or 0), int(parts["minutes"] or 0)
        clocks.append(f"{parts['date']}T{parts['clock'].replace(',', '.')}")
        zones.append((60 * hours + minutes) * (-1 if sign == "-" else 1))
    try:
        local = np.array(clocks, dtype="datetime64[ns]")
    except ValueError:
        row = next(row for row, clock in enumerate(clocks) if not _is_date(clock))
        raise _not_iso(row + 1, texts[row]) from None
    dates: NDArray[np.datetime64] = local - np.array(zones, dtype="timedelta64[m]")
    return dates


def _is_date(clock: str) -> bool:
    try:
        np.datetime64(clock, "ns")
    except ValueError:
        return False
    return True


def _not_iso(row: int, text: object) -> TypeError:
    return TypeError(
        f"`time` holds {text!r} in row {row}: instants are numbers, dates, or texts such as "
        "2023-03-14T09:26:53.5 (ISO 8601); convert the column first"
    )


def _rate_of(name: str, instants: object) -> float:
    """Return the sampling rate, in Hz, of numbers in the unit that the name states, or of dates."""
    array = _instants(instants)
    if array.dtype.kind in "mM":
        # The numbers are whole nanoseconds, so that the differences are exact.
        nanoseconds = array.astype("datetime64[ns]" if array.dtype.kind == "M" else "timedelta64[ns]")
        array = (nanoseconds - nanoseconds[:1]).astype(np.int64).astype(np.float64) * 1e-9
        name = "time [s]"
    if array.dtype.kind not in "fiu" or array.ndim != 1:
        raise TypeError(f"`time` holds {array.dtype}, not one column of numbers or dates")
    return _mechid.rate_of(name, np.ascontiguousarray(array, dtype=np.float64))


def measurements(
    sources: Sequence[object], threads_of: str, options: RecordOptions
) -> list[Measurement]:
    """Return the records that the arguments of a call name.

    Either the sources are records (measurements, or files or tables with columns), or they are the
    force and the displacement as arrays.
    """
    known_options = RecordOptions.__annotations__.keys() | Window.__annotations__.keys()
    for name in options:
        if name not in known_options:
            raise _unexpected(threads_of, name, known_options)
    if sources and all(isinstance(source, Measurement) for source in sources):
        known = [source for source in sources if isinstance(source, Measurement)]
        given = [name for name in ("fs", *_OF_TABLES, *_OF_FILES, *_KINDS) if name in options]
        if given:
            raise TypeError(f"a Measurement already has its `{given[0]}`: leave it out")
        window = _window_of(options)
        return [record.window(**window) for record in known] if window else known
    if sources and all(isinstance(source, (str, os.PathLike)) for source in sources):
        return [Measurement.open(source, **options) for source in sources]  # type: ignore[arg-type]
    for name in _OF_FILES:
        if name in options:
            raise TypeError(f"`{name}` applies only to files")
    if sources and all(_is_table(source) for source in sources):
        return [Measurement.from_table(source, **options) for source in sources]  # type: ignore[arg-type, misc]
    if len(sources) > 2:
        raise TypeError(f"{threads_of} takes a force and a displacement as arrays, got {len(sources)} arrays")
    arrays = dict(options)
    for kind, values in zip(_KINDS, sources, strict=False):
        if kind in arrays:
            raise TypeError(f"`{kind}` is given twice")
        arrays[kind] = values
    for name in _OF_TABLES:
        if name in arrays:
            raise TypeError(
                f"`{name}` belongs to files and tables, which have columns: give the arrays in N, m, m/s and "
                "m/s², or a mapping of names to arrays"
            )
    if arrays.get("fs") is None:
        raise TypeError("arrays need their sampling rate: give `fs`, in Hz")
    return [Measurement.from_arrays(**arrays)]  # type: ignore[arg-type]


_SYNONYMS = {
    **dict.fromkeys(("sample_rate", "sampling_rate", "samplerate", "rate", "rate_hz", "sr", "dt"), "fs"),
    **dict.fromkeys(("acc", "accel", "a"), "acceleration"),
    **dict.fromkeys(("vel", "v"), "velocity"),
    **dict.fromkeys(("disp", "x"), "displacement"),
    "f": "force",
    "units": "unit",
}
"""Keywords of other packages, with the keyword of this package."""


def only_window(function: str, window: Window) -> None:
    """Refuse keywords of a function that are neither its parameters nor settings of a window."""
    for name in window:
        if name not in Window.__annotations__:
            raise _unexpected(function, name, Window.__annotations__)


def _unexpected(function: str, name: str, known: Iterable[str]) -> TypeError:
    """Return the error for an unknown keyword of a function or method of the package."""
    import difflib
    import inspect

    import mechid

    called: Any = mechid
    for part in function.split("."):
        called = getattr(called, part, lambda: None)
    by_name = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    parameters = inspect.signature(called).parameters.values()
    accepted = [*known, *(p.name for p in parameters if p.kind in by_name and p.name != "self")]
    synonym = _SYNONYMS.get(name.lower())
    close = [synonym] if synonym in accepted else difflib.get_close_matches(name, accepted, n=1, cutoff=0.6)
    hint = f"; did you mean `{close[0]}`?" if close else ""
    return TypeError(f"{function}() got an unexpected keyword argument '{name}'{hint}")


def reading_of(
    fs: float | None,
    time: str | None,
    skip_lines: int,
    detrend: str,
    record_column: str | None,
    record_id: str | None,
    memory_gb: float | None = None,
    unit: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
) -> dict[str, object]:
    """Return the settings for reading a file."""
    return {
        "units": _units(unit),
        "scales": _scales(scale),
        "skip_lines": _index("skip_lines", skip_lines),
        "time": _text("time", time),
        "sample_rate_hz": _rate(fs),
        "detrend": detrend,
        "record_column": _text("record_column", record_column),
        "record_id": _text("record_id", record_id),
        **({} if memory_gb is None else {"memory_gb": _number("memory_gb", memory_gb)}),
    }


def plan_of(
    path: str | os.PathLike[str],
    channels: Mapping[str, list[str]],
    reading: Mapping[str, object],
    window: Window,
) -> dict[str, object]:
    """Return the settings that open a file."""
    return {
        "path": os.fspath(path),
        "channels": dict(channels),
        "reading": dict(reading),
        "window": _window(window),
    }


@lru_cache(maxsize=64)
def _named(counts: tuple[int, ...]) -> tuple[list[str], str]:
    """Return names for this number of columns of each kind, and their channels, as JSON."""
    channels = {
        kind: [f"{kind} {dof}" for dof in range(1, count + 1)]
        for kind, count in zip(_KINDS, counts, strict=True)
    }
    return [name for names in channels.values() for name in names], json.dumps(channels)


@final
class ResponseTable:
    """Frequency responses that were measured elsewhere, for `identify_responses`.

    Parameters
    ----------
    frequency_hz : array_like, shape (frequencies,)
        Frequencies in Hz.
    response : array_like of complex
        Responses per unit of force, in m/N, m/(s·N) or m/(s²·N): shape (frequencies,) of one degree of
        freedom, otherwise (frequencies, degrees of freedom, forces).
    quantity : {"displacement", "velocity", "acceleration"}, optional
        Measured quantity. Without it, give ``quantity`` to `identify_responses`.
    std_error : array_like, optional
        Standard error of the real part and of the imaginary part, in the shape of ``response``.
    coherence : array_like, optional
        Multiple coherence, shape (frequencies,) or (frequencies, degrees of freedom).
    points : sequence of str, optional
        Names of the degrees of freedom. Default: ``"1"``, ``"2"`` …
    forces : sequence of str, optional
        Points at which the forces act. Default: the first ones.
    segments : mapping, optional
        Segments of a record, if the responses are averages over segments; the bias of the window is
        then corrected. Keys: ``samples`` and ``count``, ``fs`` in Hz, ``hop`` (default:
        ``samples``) and ``window`` (``"hann"``, ``"hamming"``, ``"blackman"`` or ``"rectangular"``;
        default: whole periods).
    name : str
        Name of the table in messages.

    Raises
    ------
    ValueError
        If the shapes do not match, or a number is not finite.
    """

    def __init__(
        self,
        frequency_hz: ArrayLike,
        response: ArrayLike,
        *,
        quantity: Literal["displacement", "velocity", "acceleration"] | None = None,
        std_error: ArrayLike | None = None,
        coherence: ArrayLike | None = None,
        points: Sequence[str] | None = None,
        forces: Sequence[str] | None = None,
        segments: Mapping[str, Any] | None = None,
        name: str = "arrays",
    ) -> None:
        self._made: tuple[Any, ...]
        hz = _finite("frequency_hz", np.asarray(frequency_hz, dtype=np.float64))
        given = np.asarray(response)
        values = _finite("response", given.astype(np.complex128, copy=False))
        if hz.ndim != 1 or values.ndim not in (1, 3) or len(values) != len(hz):
            raise ValueError(
                f"`response` needs one entry, or one matrix, for each frequency: it has the shape {values.shape}, and "
                f"`frequency_hz` has the shape {hz.shape}"
            )
        if given.dtype.kind in "biuf":
            raise ValueError(
                f"`response` holds {given.dtype}, one part or the magnitude of a frequency response: give complex "
                "numbers, with real and imaginary parts (`np.asarray(response, complex)` if the imaginary parts are 0)"
            )
        values = values.reshape(len(hz), *(values.shape[1:] or (1, 1)))
        _, motions, columns = values.shape
        errors = None
        if std_error is not None:
            errors = _finite("std_error", np.asarray(std_error, dtype=np.float64))
            if errors.size != values.size or len(errors) != len(hz):
                raise ValueError(f"`std_error` has the shape {errors.shape}, not that of `response`")
            errors = errors.reshape(values.shape)
        coherent = None
        if coherence is not None:
            coherent = _finite("coherence", np.asarray(coherence, dtype=np.float64))
            if coherent.shape not in ((len(hz), motions), (len(hz),) if motions == 1 else ()):
                raise ValueError(f"`coherence` of shape {coherent.shape} must have the shape ({len(hz)}, {motions})")
            coherent = coherent.reshape(len(hz), motions)
        names = [str(i + 1) for i in range(motions)] if points is None else [str(p) for p in points]
        driven = names[:columns] if forces is None else [str(force) for force in forces]
        if len(names) != motions or len(driven) != columns:
            raise ValueError(
                f"there are {len(names)} names of points and {len(driven)} of forces, but `response` has "
                f"{motions} × {columns} entries at each frequency"
            )
        layout = {
            "name": name,
            "quantity": quantity,
            "points": names,
            "forces": driven,
            "segments": None if segments is None else _segments(segments),
        }
        self._made = json.dumps(layout), hz, values, errors, coherent
        self._inner = _mechid.ResponseTable.from_arrays(*self._made)

    @classmethod
    @careful
    def read(
        cls, path: str | os.PathLike[str], *, memory_gb: float | None = None
    ) -> ResponseTable:
        """Read a text or a universal file (dataset 58) of frequency responses.

        Parameters
        ----------
        path : str or path-like
            The file.
        memory_gb : float, optional
            Maximum memory, in GB, for its numbers and their analysis; by default it follows from
            the size of the file.

        Raises
        ------
        MechidError
            If the file cannot be read, or has no frequency response.
        """
        table = cls.__new__(cls)
        memory = None if memory_gb is None else _number("memory_gb", memory_gb)
        table._made = os.fspath(path), memory
        table._inner = _mechid.ResponseTable.read(path, memory)
        return table

    @property
    def name(self) -> str:
        """Name of the table in messages."""
        return self._inner.name

    def __copy__(self) -> ResponseTable:
        return self

    def __deepcopy__(self, memo: object) -> ResponseTable:
        return self

    def __reduce__(self) -> tuple[object, tuple[Any, ...]]:
        return _made_again, (self._made,)

    def __repr__(self) -> str:
        quantity = self._inner.quantity or "no quantity stated"
        return f"<ResponseTable {self.name!r}: {quantity}, {self._inner.frequencies} frequencies>"


def _made_again(made: tuple[Any, ...]) -> ResponseTable:
    """Return a table that was pickled: from its arrays, or from its file."""
    if len(made) == 2:
        return ResponseTable.read(made[0], memory_gb=made[1])
    table = ResponseTable.__new__(ResponseTable)
    table._made, table._inner = made, _mechid.ResponseTable.from_arrays(*made)
    return table


def _segments(given: Mapping[str, Any]) -> list[float]:
    """Return samples, hop, number, code of the window, and rate in Hz."""
    windows = ("hann", "hamming", "blackman", "rectangular")
    known = ("samples", "hop", "count", "window", "fs")
    for name in given:
        if name not in known:
            raise TypeError(f"`segments` has no `{name}`: it has {', '.join(known)}")
    for name in ("samples", "count", "fs"):
        if name not in given:
            raise TypeError(f"`segments` needs its `{name}`")
    window = given.get("window")
    if window is not None and window not in windows:
        raise ValueError(f"`window` of `segments` must be one of {', '.join(windows)}, got {window!r}")
    code = 0 if window is None else windows.index(window) + 1
    samples = float(given["samples"])
    return [samples, float(given.get("hop", samples)), float(given["count"]), float(code), float(given["fs"])]


_Numbers = TypeVar("_Numbers", bound="NDArray[Any]")


def _finite(name: str, values: _Numbers) -> _Numbers:
    if not np.isfinite(values).all():
        raise ValueError(f"`{name}` has a value that is not finite")
    return values


def _series_unit(kind: str, values: object) -> str | None:
    """Return the unit that a series of pandas or xarray states, in an attribute or in brackets."""
    attrs, name = getattr(values, "attrs", None), getattr(values, "name", None)
    units = attrs.get("units", attrs.get("unit")) if isinstance(attrs, Mapping) else None
    if isinstance(units, Mapping):
        units = units.get(name)
    if isinstance(units, str):
        if isinstance(name, str):
            _only_one_unit(name, units, kind, "`attrs`")
        return units
    in_brackets = _IN_BRACKETS.findall(name) if isinstance(name, str) else []
    return "; ".join(in_brackets) or None


def _with_units(names: list[str], units: list[str | None], channels: str) -> tuple[list[str], str]:
    """Return names that state the units of their series, one for each kind, and the channels."""
    groups = json.loads(channels)
    unit_of = {name: unit for unit, group in zip(units, groups.values(), strict=True) for name in group}
    stated = {name: f"{name} [{unit}]" if unit else name for name, unit in unit_of.items()}
    renamed = {kind: [stated[name] for name in group] for kind, group in groups.items()}
    return [stated[name] for name in names], json.dumps(renamed)


def matrix(name: str, values: object) -> NDArray[np.float64]:
    """Return an array of samples × degrees of freedom of real numbers."""
    return _array(name, values)


def _is_table(source: object) -> bool:
    if isinstance(source, Sequence) and not isinstance(source, str):
        return _are_channels(source)
    if _are_channels(getattr(source, "channels", None)):
        return True
    return isinstance(source, Mapping) or (
        hasattr(source, "keys") and (hasattr(source, "columns") or hasattr(source, "data_vars"))
    )


def _window_of(options: RecordOptions) -> Window:
    window: Window = {}
    if "start" in options:
        window["start"] = options["start"]
    if "period" in options:
        window["period"] = options["period"]
    if "periods" in options:
        window["periods"] = options["periods"]
    return window


def _window(window: Window) -> dict[str, int | None]:
    kept: dict[str, int | None] = {"start": 1}
    for name, value in window.items():
        kept[name] = _count(name, value)
    return kept


def _window_json(window: Window) -> str:
    # Whole numbers are written here, four times as fast as by the general function.
    kept = (f'"{name}": {"null" if count is None else count}' for name, count in _window(window).items())
    return f"{{{', '.join(kept)}}}"


def _count(name: str, value: object) -> int | None:
    if value is None:
        return None
    count = _index(name, value)
    if count < 1:
        raise ValueError(f"`{name}` is counted from 1, got {count}")
    return count


def _index(name: str, value: object) -> int:
    if isinstance(value, (bool, np.bool_)):
        raise TypeError(f"`{name}` must be a whole number, got {value!r}")
    try:
        return value.__index__()  # type: ignore[attr-defined, no-any-return]
    except AttributeError:
        raise TypeError(f"`{name}` must be a whole number, got {value!r}") from None


def _rate(fs: float | None) -> float | None:
    return None if fs is None else _number("fs", fs)


def _text(name: str, value: object) -> str | None:
    if value is None or isinstance(value, str):
        return value
    raise TypeError(f"`{name}` must be a text, got {value!r}")


def _pairs(name: str, given: object) -> dict[str, object]:
    """Return a setting that has a value for each of some columns."""
    if given is None:
        return {}
    if not isinstance(given, Mapping) or not all(isinstance(column, str) for column in given):
        raise TypeError(f"`{name}` must be a mapping of names of columns, such as {{'acc': …}}, got {given!r}")
    return dict(given)


def _units(given: object) -> dict[str, str]:
    units = _pairs("unit", given)
    for column, unit in units.items():
        if not isinstance(unit, str):
            raise TypeError(f"`unit` of {column!r} must be a text, got {unit!r}")
    return units  # type: ignore[return-value]


def _scales(given: object) -> dict[str, float]:
    scales = {}
    for column, factor in _pairs("scale", given).items():
        try:
            scales[column] = _number("scale", factor)
        except TypeError:
            raise TypeError(f"`scale` of {column!r} must be a number, got {factor!r}") from None
    return scales


def _number(name: str, value: object) -> float:
    if isinstance(value, (bool, np.bool_, str, bytes)):
        raise TypeError(f"`{name}` must be a number, got {value!r}")
    try:
        return float(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"`{name}` must be a number, got {value!r}") from None


def _names(kind: str, given: object) -> list[str]:
    if isinstance(given, str):
        return [name.strip() for name in given.split(",")]
    if isinstance(given, Sequence) and all(isinstance(name, str) for name in given):
        return list(given)
    raise TypeError(f"`{kind}` of a file or table must be the name of a column, or several names, got {given!r}")


def no_column(name: str, known: object) -> Exception:
    available = ", ".join(str(column) for column in known)  # type: ignore[attr-defined]
    quoted = json.dumps(name), json.dumps(available)
    return MechidError(
        f'there is no column "{name}"; the columns are {available}',
        f"Analysis(NoColumn {{ column: {quoted[0]}, available: {quoted[1]} }})",
    )


def _columns(name: str, values: object) -> list[NDArray[np.float64]]:
    """Return the columns of an array of real numbers."""
    return list(_array(name, values).T)


def _array(name: str, values: object) -> NDArray[np.float64]:
    """Return an array of samples × degrees of freedom, of any layout; it is copied only if
    necessary."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise ValueError(f"`{name}` has masked values: fill them, or leave these samples out")
    array = np.asarray(values)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"`{name}` holds {array.dtype}, not real numbers")
    if array.ndim == 1:
        array = array[:, np.newaxis]
    if array.ndim != 2:
        shape = "×".join(str(size) for size in array.shape) or "no dimension"
        raise ValueError(
            f"`{name}` has the shape (samples,) or (samples, degrees of freedom), got {shape}"
        )
    array = array.astype(np.float64, copy=False)
    return array if array.flags.aligned else array.copy()

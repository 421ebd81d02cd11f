"""Many records by one analysis, with any engine of ``concurrent.futures``.

>>> import tempfile
>>> from mechid import fleet
>>> analysis = {"channels": {"force": ["force"], "displacement": ["displacement"]},
...             "window": {"period": 256}}
>>> with tempfile.TemporaryDirectory() as out:
...     found = fleet.run(["examples/machine.csv", "lost.csv"], analysis, out)
>>> found.records, found.failed, found.failures[0].code
(2, 1, 'io.read')
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from . import _mechid
from ._errors import MechidError, careful
from ._figures import Figure, read_page
from ._mapping import ReadOnly
from ._records import no_column
from ._results import Plotted, description_of, framed

if TYPE_CHECKING:
    import pyarrow
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Failure", "Summary", "Trends", "identify_batch", "run", "simulate", "trends"]


@dataclass(frozen=True)
class Failure:
    """Records that failed for one reason.

    ``code`` is that of `MechidError`; ``record`` is the first of the records by name, and
    ``message`` states its failure.
    """

    code: str
    records: int
    record: str
    message: str


@dataclass(frozen=True)
class Summary:
    """Summary of a run over many records; ``str`` returns the text of the program.

    ``other_parts`` is the number of parts in the folder with other records, other versions of these
    records, or another analysis; ``left_out`` names paths that cannot be records (named pipes,
    sockets, devices); ``elapsed_s`` is in s.
    """

    records: int
    failed: int
    failures: tuple[Failure, ...]
    parts: int
    computed_parts: int
    computed_records: int
    other_parts: int
    left_out: tuple[str, ...]
    elapsed_s: float
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Trends(Plotted):
    """Trends of the results of many records; ``str`` returns the text of the program.

    ``fields`` is the JSON of ``mechid trends --json``: ``series`` with ``name``, ``unit``,
    ``median``, ``spread``, ``standard_error`` and ``points``, ``failures`` and counts. ``page`` is
    the report as HTML; ``figures`` are its figures by the names of the quantities.
    """

    fields: Mapping[str, Any]
    text: str
    page: str

    def __str__(self) -> str:
        return self.text

    @property
    def figures(self) -> Mapping[str, Figure]:
        """Figures of the page by the names of the quantities, to draw with Matplotlib."""
        names = (series["name"] for series in self.fields["series"])
        return ReadOnly(dict(zip(names, read_page(self.page).values(), strict=True)))

    def _repr_html_(self) -> str:
        return framed(self.page, self.text)


@careful
def simulate(
    experiment: Mapping[str, Any] | str | os.PathLike[str],
    out: str | os.PathLike[str],
    runs: int | Mapping[str, ArrayLike],
) -> str:
    """Simulate many runs of a described experiment, into one Parquet file.

    Its column ``run`` names the run of each row; with ``"record_column": "run"`` in ``reading`` of
    the analysis, `run` identifies all of them.

    Parameters
    ----------
    experiment : mapping or path
        Description of the experiment, as for `mechid.simulate`.
    out : path
        The file.
    runs : int or mapping
        Number of runs with different noise, whose seed increases by 1 from run to run; or the
        values of the fields that change, one number per run, such as ``{"system.damping": [1, 2],
        "noise.seed": [1, 2]}``. List entries are counted from 1: ``excitation.1.amplitude``.

    Returns
    -------
    str
        Summary of the written file, as the program prints it.

    Raises
    ------
    MechidError
        If the description is wrong, has no such field, or the file cannot be written.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from mechid import fleet
    >>> rig = {"system": {"mass": 25, "damping": 188.5, "stiffness": 142122},
    ...        "sampling": {"samples": 256, "rate_hz": 128},
    ...        "excitation": {"lines": "4:60", "amplitude": 2}, "periods": 2,
    ...        "noise": {"displacement": {"fraction_of_rms": 0.01}, "seed": 1}}
    >>> analysis = {"channels": {"force": ["force"], "displacement": ["displacement"]},
    ...             "reading": {"record_column": "run"}, "window": {"period": 256}}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     records = pathlib.Path(folder) / "runs.parquet"
    ...     _ = fleet.simulate(rig, records, runs=50)
    ...     found = fleet.run(records, analysis, pathlib.Path(folder) / "results")
    ...     mass = fleet.trends(pathlib.Path(folder) / "results").fields["series"][0]
    >>> found.records, mass["name"], 0.7 < mass["spread"] / mass["standard_error"] < 1.3
    (50, 'm', True)
    """
    described = description_of(experiment)
    if described is None:
        raise TypeError("an experiment must be a mapping, or the path of a .json file")
    count: int | None = None
    fields: list[tuple[str, NDArray[np.float64]]] = []
    if isinstance(runs, Mapping):
        fields = [
            (name, np.ascontiguousarray(values, dtype=np.float64)) for name, values in runs.items()
        ]
    else:
        count = runs
    return _mechid.fleet_simulate(*described, count, fields, os.fspath(out))[0]


@careful
def trends(
    results: str | os.PathLike[str],
    over: Literal["order", "number"] = "order",
    *,
    title: str | None = None,
) -> Trends:
    """Read the results of many records as trends over the records.

    Parameters
    ----------
    results : path
        The folder of results of `run` or ``mechid fleet``.
    over : {"order", "number"}
        Order of the records: as their names sort, or by the last number in the name.
    title : str, optional
        Heading of the page. Default: the folder.

    Returns
    -------
    Trends
        Parameters, natural frequencies and damping ratios over the records, outliers, failures.

    Raises
    ------
    MechidError
        If there are no results, or they cannot be read.
    """
    folder = os.fspath(results)
    heading = title if title is not None else f"Results in {folder}"
    text, fields, page = _mechid.fleet_trends(folder, over == "number", heading)
    return Trends(fields=json.loads(fields), text=text, page=page)


@careful
def run(
    records: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    analysis: Mapping[str, Any] | str | os.PathLike[str],
    out: str | os.PathLike[str],
    executor: Executor | None = None,
    *,
    part_records: int = 32,
    progress: Callable[[int, int], object] | None = None,
    isolate: bool = True,
    record_memory_gb: float = 8.0,
    record_seconds: float = 600.0,
) -> Summary:
    """Identify many records, into a folder of Parquet files with one row per record.

    The records are divided into parts, in the order of their paths. A part is one file of the
    folder, complete or absent; an existing part is not computed again. Therefore the same call
    continues an interrupted run.

    Parameters
    ----------
    records : path or iterable of paths
        The records, of any format; a folder means the files in it, and a Parquet file with many
        records means those that the ``record_column`` of ``reading`` names.
    analysis : mapping or path
        The analysis: ``channels``, ``reading``, ``window`` and ``identify``; or the path of its
        JSON file.
    out : path
        The folder of results; it is created if it does not exist. The paths of the folder and of
        the records must be valid for every worker.
    executor : concurrent.futures.Executor, optional
        Engine of the work: a pool of threads or processes, or that of a Dask client
        (``client.get_executor()``). Default: one thread per processor.
    part_records : int
        Number of records in a part.
    progress : callable, optional
        Function that is called with the number of completed records and the number of all records.
    isolate : bool
        Whether to process records in separate processes, which every worker starts with its own
        interpreter: a record that takes too much memory or time, or ends its process, has an error
        in its row. If false, a worker computes in its own process.
    record_memory_gb : float
        Memory that a record may take, in GB, including the 0.03 GB of its process; only Linux
        enforces it.
    record_seconds : float
        Time that a record may take, in s.

    Returns
    -------
    Summary
        Number of records, speed, and the failures with their reasons.

    Raises
    ------
    MechidError
        If the analysis is invalid, or a part cannot be written. The error of a record is in its
        row.
    """
    saved = _saved(analysis)
    folder = os.fspath(out)
    given = [records] if isinstance(records, str | os.PathLike) else list(records)
    begun = time.monotonic()
    parts, left_out = _mechid.fleet_begin(given, saved, folder, part_records)
    limits = (float(record_memory_gb), float(record_seconds)) if isolate else None
    if executor is None:
        own = ThreadPoolExecutor(os.cpu_count())
    with nullcontext(executor) if executor is not None else own as engine:
        futures = [engine.submit(_part, part, saved, folder, limits) for part in parts]
        try:
            done = list(_told(futures, sum(map(len, parts)), progress))
        except BaseException:
            for future in futures:
                future.cancel()
            raise
    text, summary = _mechid.fleet_summary(done, left_out, folder, time.monotonic() - begun)
    fields: dict[str, Any] = json.loads(summary)
    fields["failures"] = tuple(Failure(**failure) for failure in fields["failures"])
    fields["left_out"] = tuple(fields["left_out"])
    return Summary(**fields, text=text)


@careful
def identify_batch(
    batch: pyarrow.RecordBatch | pyarrow.Table, analysis: Mapping[str, Any] | str | os.PathLike[str]
) -> pyarrow.Table:
    """Identify the records of an Arrow batch, and return a table with one row per record.

    This is a pure function of its arguments, for engines that pass batches: ``mapInArrow`` and
    ``applyInArrow`` of Spark, ``map_batches`` of Ray, ``map_partitions`` of Dask.

    Parameters
    ----------
    batch : pyarrow.RecordBatch or pyarrow.Table
        The records, one per row with lists of numbers as columns, or one sample per row. The
        ``record_column`` of ``reading`` names them; without it the rows of lists are numbered from 1,
        and rows of samples are one record.
    analysis : mapping or path
        The analysis, as in `run`; the sampling rate is its ``sample_rate_hz``, or that of a time
        column.

    Returns
    -------
    pyarrow.Table
        The columns that `run` writes, in the order of the records. The error of a record is in its
        row.

    Raises
    ------
    MechidError
        If the analysis is invalid, or the batch has no ``record_column``.

    Examples
    --------
    >>> import numpy as np, pyarrow as pa
    >>> from mechid import fleet
    >>> rig = np.loadtxt("examples/machine.csv", delimiter=",", skiprows=1)
    >>> batch = pa.table({"day": ["monday"], "time": [rig[:, 0]], "force": [rig[:, 1]], "x": [rig[:, 2]]})
    >>> analysis = {"channels": {"force": ["force"], "displacement": ["x"]},
    ...             "reading": {"record_column": "day"}, "window": {"period": 256}}
    >>> found = fleet.identify_batch(batch, analysis)
    >>> found["record"].to_pylist(), found["error"].null_count
    (['monday'], 1)
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    saved = _saved(analysis)
    column = _mechid.fleet_record_column(saved)
    if column is not None and column not in batch.schema.names:
        raise no_column(column, batch.schema.names)
    names = None if column is None else batch.column(column).to_pylist()
    channels = {field.name: batch.column(field.name) for field in batch.schema if field.name != column}
    lists = {name: cells for name, cells in channels.items() if _is_list(cells.type)}
    if lists:
        names = range(1, batch.num_rows + 1) if names is None else names
        records = [
            (str(record), [(name, _numbers(cells[row].values)) for name, cells in lists.items()])
            for row, record in enumerate(names)
        ]
    else:
        samples = [
            (name, _numbers(cells)) for name, cells in channels.items() if _is_number(cells.type)
        ]
        rows = {"the record": np.arange(batch.num_rows)} if names is None else _rows_of(names)
        records = [
            (str(record), [(name, np.ascontiguousarray(values[at])) for name, values in samples])
            for record, at in rows.items()
        ]
    found: pa.Table = pq.read_table(pa.BufferReader(_mechid.fleet_rows(records, saved)))
    return found


def _saved(analysis: Mapping[str, Any] | str | os.PathLike[str]) -> str:
    """Return an analysis as JSON."""
    if isinstance(analysis, Mapping):
        return json.dumps(analysis)
    try:
        return Path(analysis).read_text(encoding="utf-8")
    except OSError as error:
        name = os.fspath(analysis)
        variant = f"Io(Read {{ file: {json.dumps(name)} }})"
        raise MechidError(f"cannot read {name}: {error.strerror}", variant) from None


def _is_number(kind: pyarrow.DataType) -> bool:
    import pyarrow.types as types

    return bool(types.is_floating(kind) or types.is_integer(kind))


def _is_list(kind: pyarrow.DataType) -> bool:
    import pyarrow.types as types

    lists = (types.is_list, types.is_large_list, types.is_fixed_size_list)
    return any(is_one(kind) for is_one in lists) and _is_number(kind.value_type)


def _numbers(values: pyarrow.Array | pyarrow.ChunkedArray | None) -> NDArray[np.float64]:
    """Return numbers, with NaN for missing ones; none for a list that is missing."""
    if values is None:
        return np.empty(0)
    return np.asarray(values.to_numpy(zero_copy_only=False), dtype=np.float64)


def _rows_of(names: list[Any]) -> dict[Any, NDArray[np.intp]]:
    """Return the rows of each record, in the order in which the records appear."""
    rows: dict[Any, list[int]] = {}
    for row, name in enumerate(names):
        rows.setdefault(name, []).append(row)
    return {name: np.asarray(at, dtype=np.intp) for name, at in rows.items()}


def _part(
    records: list[_mechid._Place], analysis: str, folder: str, limits: tuple[float, float] | None
) -> str:
    """Compute one part in the process that the engine has chosen, with its own interpreter."""
    isolation = None if limits is None or not sys.executable else (sys.executable, *limits)
    return _mechid.fleet_part(records, analysis, folder, isolation)


def _told(
    futures: list[Future[str]], count: int, progress: Callable[[int, int], object] | None
) -> Iterable[str]:
    records = 0
    for future in as_completed(futures):
        part = future.result()
        records += json.loads(part)["records"]
        if progress is not None:
            progress(records, count)
        yield part

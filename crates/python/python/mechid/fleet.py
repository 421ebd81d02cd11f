"""Many records by one analysis, over any engine of ``concurrent.futures``.

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
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _mechid

__all__ = ["Failure", "Summary", "run"]


@dataclass(frozen=True)
class Failure:
    """Records that failed for one reason.

    ``code`` is that of `MechidError`; ``record`` is the first of the records by name, and ``message``
    what is wrong with it.
    """

    code: str
    records: int
    record: str
    message: str


@dataclass(frozen=True)
class Summary:
    """What a run over many records did; ``str`` tells it as the program does.

    ``other_parts`` counts the parts in the folder that are of other records, of another version of
    these, or of another analysis; ``elapsed_s`` is in s.
    """

    records: int
    failed: int
    failures: tuple[Failure, ...]
    parts: int
    computed_parts: int
    computed_records: int
    other_parts: int
    elapsed_s: float
    text: str

    def __str__(self) -> str:
        return self.text


def run(
    records: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    analysis: Mapping[str, Any] | str | os.PathLike[str],
    out: str | os.PathLike[str],
    executor: Executor | None = None,
    *,
    part_records: int = 32,
    progress: Callable[[int, int], object] | None = None,
) -> Summary:
    """Identify many records, into a folder of Parquet files with one row per record.

    The records are divided into parts, by rising path. A part is one file of the folder, complete or
    not there; one that is there is not computed again. So a run that was interrupted, at whatever
    moment, is continued by calling it again.

    Parameters
    ----------
    records : path or iterable of paths
        The records, of any format; a folder stands for the files in it.
    analysis : mapping or path
        The analysis: ``channels``, ``reading``, ``window`` and ``identify``; or a JSON file of it.
    out : path
        The folder of results; it is made if it is not there. Every worker must reach it, and the
        records, by the same paths.
    executor : concurrent.futures.Executor, optional
        Engine of the work: a pool of threads or processes, or that of a Dask client
        (``client.get_executor()``). Without, as many threads as there are processors.
    part_records : int
        Number of records in a part.
    progress : callable, optional
        Called with the number of records done, and of all.

    Returns
    -------
    Summary
        How many records, how fast, and which failed why.

    Raises
    ------
    MechidError
        If the analysis cannot be understood, or a part cannot be written. What is wrong with a record
        is in its row.
    """
    if isinstance(analysis, Mapping):
        saved = json.dumps(analysis)
    else:
        saved = Path(analysis).read_text(encoding="utf-8")
    folder = os.fspath(out)
    names = sorted(_files(records))
    if part_records < 1:
        raise ValueError("part_records: a part has one record at least")
    begun = time.monotonic()
    _mechid.fleet_begin(saved, folder)
    if executor is None:
        own = ThreadPoolExecutor(os.cpu_count())
    with nullcontext(executor) if executor is not None else own as engine:
        parts = [names[at : at + part_records] for at in range(0, len(names), part_records)]
        futures = [engine.submit(_part, part, saved, folder) for part in parts]
        try:
            done = list(_told(futures, len(names), progress))
        except BaseException:
            for future in futures:
                future.cancel()
            raise
    text, summary = _mechid.fleet_summary(done, folder, time.monotonic() - begun)
    fields: dict[str, Any] = json.loads(summary)
    fields["failures"] = tuple(Failure(**failure) for failure in fields["failures"])
    return Summary(**fields, text=text)


def _part(records: list[str], analysis: str, folder: str) -> str:
    """Compute one part, wherever the engine has put it."""
    return _mechid.fleet_part(records, analysis, folder)


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


def _files(records: str | os.PathLike[str] | Iterable[str | os.PathLike[str]]) -> set[str]:
    """Return the files, those of folders without hidden ones."""
    given = [records] if isinstance(records, str | os.PathLike) else list(records)
    files: set[str] = set()
    for path in map(Path, given):
        if path.is_dir():
            files |= {str(f) for f in path.iterdir() if not f.name.startswith(".") and not f.is_dir()}
        else:
            files.add(str(path))
    return files

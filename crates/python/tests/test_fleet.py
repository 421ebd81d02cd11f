"""Many records: the same table by whatever engine, and after whatever ends a worker."""

from __future__ import annotations

import multiprocessing
import os
import signal
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pytest

import mechid
from mechid import fleet

from .conftest import ROOT

pq = pytest.importorskip("pyarrow.parquet")

ANALYSIS = {
    "channels": {"force": ["force"], "displacement": ["displacement"]},
    "window": {"period": 256},
    "identify": {"fit": {"domain": "spectra", "method": "maximum-likelihood"}},
}


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Twenty records that can be identified, and three that cannot."""
    home = tmp_path_factory.mktemp("records")
    rig = (ROOT / "examples/machine.csv").read_text()
    texts = {f"good-{k:02}.csv": f"# record {k}\n{rig}" for k in range(20)}
    texts |= {"cut.csv": "\n".join(rig.splitlines()[:100]), "empty.csv": "", "other.csv": rig.replace("force", "f")}
    for name, text in texts.items():
        (home / name).write_text(text)
    return [home / name for name in texts]


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def engines() -> list[str]:
    return ["threads", "processes", "dask"]


def run(
    records: list[Path], out: Path, executor: Executor | None = None, part_records: int = 4
) -> fleet.Summary:
    return fleet.run(records, ANALYSIS, out, executor, part_records=part_records)


@pytest.mark.parametrize("engine", engines())
@pytest.mark.filterwarnings("ignore")
def test_every_engine_makes_the_same_table(
    engine: str, records: list[Path], tmp_path: Path, program: object
) -> None:
    own = run(records, tmp_path / "own")
    assert (own.records, own.failed, own.computed_parts) == (23, 3, 6)
    assert {failure.code for failure in own.failures} == {
        "analysis.window", "io.empty", "io.missing-column"
    }
    out = tmp_path / engine
    if engine == "threads":
        with ThreadPoolExecutor(3) as pool:
            found = run(records, out, pool)
    elif engine == "processes":
        with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
            found = run(records, out, pool)
    else:
        distributed = pytest.importorskip("distributed")
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as cluster, cluster.get_client() as client:
            found = run(records, out, client.get_executor())
    assert (found.records, found.failures) == (own.records, own.failures)
    assert contents(out) == contents(tmp_path / "own")


def test_a_killed_worker_loses_and_doubles_nothing(records: list[Path], tmp_path: Path) -> None:
    run(records, tmp_path / "undisturbed", part_records=1)
    out, broken = tmp_path / "killed", 0
    for round_ in range(3):
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            victim = pool.submit(os.getpid).result()

            def kill(done: int, _: int, victim: int = victim, after: int = 3 + 5 * round_) -> None:
                if done == after:
                    os.kill(victim, signal.SIGKILL)

            try:
                fleet.run(records, ANALYSIS, out, pool, part_records=1, progress=kill)
            except BrokenProcessPool:
                broken += 1
    assert broken > 0
    found = run(records, out, part_records=1)
    assert found.records == len(records)
    assert contents(out) == contents(tmp_path / "undisturbed")
    assert run(records, out, part_records=1).computed_records == 0


def test_the_table_has_the_numbers_of_single_identifications(
    records: list[Path], tmp_path: Path
) -> None:
    seen: list[tuple[int, int]] = []
    fleet.run(records, ANALYSIS, tmp_path / "out", progress=lambda done, of: seen.append((done, of)))
    assert seen[-1] == (23, 23)
    rows = pq.read_table(tmp_path / "out").to_pylist()
    assert [row["record"] for row in rows] == [str(path) for path in sorted(records)]
    found = mechid.identify(
        records[0], force="force", displacement="displacement", period=256,
        method="maximum-likelihood",
    )
    row = next(row for row in rows if row["record"] == str(records[0]))
    values = dict(zip(row["parameter"], row["value"], strict=True))
    errors = dict(zip(row["parameter"], row["standard_error"], strict=True))
    for name, parameter in found.parameters.items():
        assert (values[name], errors[name]) == (parameter.value, parameter.std_error)
    bad = {row["error_code"]: row for row in rows if row["error"] is not None}
    assert len(bad) == 3
    for code, row in bad.items():
        assert row["value"] == []
        with pytest.raises(mechid.MechidError) as raised:
            mechid.identify(row["record"], force="force", displacement="displacement", period=256)
        assert raised.value.code == code


def test_parquet_columns_are_those_of_pyarrow(tmp_path: Path) -> None:
    import pyarrow as pa

    rng = np.random.default_rng(7)
    force, x = rng.standard_normal((2, 4096)) * [[1e3], [1e-6]]
    table = pa.table({"force": force, "x": x.astype(np.float32)})
    path = tmp_path / "record.parquet"
    for options in ({}, {"compression": "zstd"}, {"use_dictionary": False, "compression": "none"},
                    {"data_page_version": "2.0", "row_group_size": 1000}):
        pq.write_table(table, path, **options)
        record = mechid.Measurement.open(path, force="force", displacement="x", fs=1000.0)
        read = pq.read_table(path)
        assert np.array_equal(record.force[:, 0], read["force"].to_numpy())
        assert np.array_equal(record.responses["displacement"][:, 0], read["x"].to_numpy().astype(float))


def test_an_analysis_that_is_wrong_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(mechid.MechidError, match="chanels"):
        fleet.run(["a.csv"], {"chanels": {}}, tmp_path)
    with pytest.raises(mechid.MechidError) as raised:
        fleet.run(["a.csv"], {}, tmp_path)
    assert raised.value.code == "analysis.no-force"

"""Many records: every engine gives the same table, also after a worker has ended."""

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
    "identify": {"method": "maximum-likelihood"},
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


@pytest.mark.parametrize("engine", ["threads", "processes"])
def test_a_file_of_many_records_makes_a_row_for_each(engine: str, tmp_path: Path) -> None:
    import pyarrow as pa

    rig = np.loadtxt(ROOT / "examples/machine.csv", delimiter=",", skiprows=1)
    days = ["monday", "tuesday", "friday"]
    table = pa.table(
        {
            "day": np.repeat(days, len(rig)),
            "time": pa.array(np.tile(rig[:, 0], 3)),
            "force": pa.array(np.tile(rig[:, 1], 3)),
            "displacement": pa.array(np.concatenate([scale * rig[:, 2] for scale in (1, 2, 4)])),
        }
    )
    week = tmp_path / "week.parquet"
    pq.write_table(table, week, row_group_size=700)
    analysis = ANALYSIS | {"reading": {"record_column": "day"}}
    pool = ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) if engine == "processes" else None
    found = fleet.run(week, analysis, tmp_path / "out", pool, part_records=2)
    assert (found.records, found.failed, found.parts) == (3, 0, 2)
    rows = {row["record_id"]: row for row in pq.read_table(tmp_path / "out").to_pylist()}
    for day, scale in zip(days, (1, 2, 4), strict=True):
        alone = mechid.identify(
            week, record_column="day", record_id=day, force="force", displacement="displacement",
            period=256, method="maximum-likelihood",
        )  # fmt: skip
        assert rows[day]["value"][0] == alone.parameters["m"].value
        assert np.isclose(scale * rows[day]["value"][0], rows["monday"]["value"][0], rtol=1e-9)
    with pytest.raises(mechid.MechidError) as failure:
        mechid.inspect(week, record_column="day", record_id="sunday")
    assert failure.value.code == "analysis.record-id"


def test_a_batch_makes_the_rows_that_a_run_makes(tmp_path: Path) -> None:
    import pyarrow as pa

    rig = np.loadtxt(ROOT / "examples/machine.csv", delimiter=",", skiprows=1)
    analysis = ANALYSIS | {"reading": {"record_column": "day"}}
    cells = {"time": rig[:, 0], "force": rig[:, 1], "displacement": rig[:, 2]}
    broken = np.where(np.arange(len(rig)) == 7, np.nan, rig[:, 2])
    lists = pa.RecordBatch.from_pydict(
        {"day": ["monday", "broken", "friday"]}
        | {name: [values] * 3 for name, values in cells.items()}
        | {"displacement": [rig[:, 2], broken, rig[:, 2]]}
    )
    # The same records with one sample per row, the rows of different records mixed.
    samples = pa.table(
        {"day": np.tile(["monday", "broken", "friday"], len(rig))}
        | {name: np.repeat(values, 3) for name, values in cells.items()}
        | {"displacement": np.column_stack([rig[:, 2], broken, rig[:, 2]]).ravel()}
    )
    found = fleet.identify_batch(lists, analysis)
    assert found["record"].to_pylist() == ["monday", "broken", "friday"]
    assert found["error_code"].to_pylist() == [None, "io.not-finite", None]
    assert fleet.identify_batch(samples, analysis) == found
    fleet.run(ROOT / "examples/machine.csv", ANALYSIS, tmp_path)
    alone = pq.read_table(tmp_path)
    assert found.schema.equals(alone.schema)
    same = [name for name in found.column_names if name not in ("record", "analysis_hash")]
    assert found.select(same).slice(0, 1).to_pylist() == alone.select(same).to_pylist()
    with pytest.raises(mechid.MechidError):
        fleet.identify_batch(lists, {"channels": {}})
    whole = fleet.identify_batch(pa.table(cells), ANALYSIS)
    assert whole["record"].to_pylist() == ["the record"]
    assert whole["value"].to_pylist() == found["value"].to_pylist()[:1]


RIG = {
    "system": {"mass": 25, "damping": 188.5, "stiffness": 142122},
    "sampling": {"samples": 256, "rate_hz": 128},
    "excitation": {"lines": "4:60", "amplitude": 2},
    "periods": 2,
    "noise": {"displacement": {"fraction_of_rms": 0.01}, "seed": 1},
}
OF_RUNS = {**ANALYSIS, "reading": {"record_column": "run"}}


def test_a_study_changes_what_it_says(tmp_path: Path) -> None:
    """Reference: the masses of the study are found again, run by run."""
    masses = np.array([20.0, 25.0, 30.0])
    text = fleet.simulate(RIG, tmp_path / "runs.parquet", {"system.mass": masses, "noise.seed": [1, 2, 3]})
    assert "3 runs, 1536 samples" in text and "system.mass, noise.seed" in text
    table = pq.read_table(tmp_path / "runs.parquet")
    assert table.column_names == [
        "run", "time", "force", "displacement", "velocity", "acceleration", "system.mass", "noise.seed",
    ]
    assert table["system.mass"].to_numpy().reshape(3, -1).std(axis=1).max() == 0
    fleet.run(tmp_path / "runs.parquet", OF_RUNS, tmp_path / "results")
    found = fleet.trends(tmp_path / "results", title="A study")
    mass = found.fields["series"][0]
    values = np.array([point["value"] for point in mass["points"]])
    errors = np.array([point["standard_error"] for point in mass["points"]])
    assert mass["name"] == "m" and (np.abs(values - masses) < 4 * errors).all()
    assert "<title>A study" in found.page and "3 records: 3 identified" in str(found)


def test_a_study_that_is_none_is_refused(tmp_path: Path) -> None:
    for runs, why in [
        ({"system.mas": [1.0]}, "system"),
        ({"noise.seed": [1.5]}, "noise.seed"),
        ({"system.mass": [25.0, np.nan]}, "system.mass"),
        ({"system.mass": [25.0], "noise.seed": [1, 2]}, "system.mass"),
        (0, "at least one run"),
    ]:
        with pytest.raises(mechid.MechidError, match=why):
            fleet.simulate(RIG, tmp_path / "runs.parquet", runs)
    assert not list(tmp_path.iterdir())
    with pytest.raises(mechid.MechidError):
        fleet.trends(tmp_path / "nowhere")

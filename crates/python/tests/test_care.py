"""No input is silently read as another machine, other samples, or another exception."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import mechid
from mechid import fleet

SPARSE = 70


def described(folder: Path, stiffness: float) -> None:
    """Write a chain of masses as Matrix Market files, and the experiment that names them."""
    folder.mkdir(exist_ok=True)
    for name, value in {"m": 1.0, "c": 2.0, "k": stiffness}.items():
        rows = "\n".join(f"{dof} {dof} {value}" for dof in range(1, SPARSE + 1))
        head = f"%%MatrixMarket matrix coordinate real general\n{SPARSE} {SPARSE} {SPARSE}\n"
        (folder / f"{name}.mtx").write_text(head + rows + "\n", encoding="utf-8")
    (folder / "e.json").write_text(
        """{"system": {"mass": "m.mtx", "damping": "c.mtx", "stiffness": "k.mtx"},
            "sampling": {"samples": 64, "rate_hz": 100}, "outputs": [1],
            "excitation": {"dof": 1, "lines": "1:8", "amplitude": 1}}""",
        encoding="utf-8",
    )


def test_matrices_lie_beside_the_description(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    described(tmp_path / "sub", 1e4)
    alone = mechid.simulate(tmp_path / "sub" / "e.json")
    # Files with the same names in the current folder describe another machine.
    described(tmp_path, 1e2)
    monkeypatch.chdir(tmp_path)
    for path in ("sub/e.json", Path("sub") / "e.json"):
        assert np.array_equal(mechid.simulate(path).displacement, alone.displacement)
    other = mechid.simulate("e.json")
    assert np.abs(other.displacement).max() > 10 * np.abs(alone.displacement).max()
    # A mapping has no folder, so its files are in the current folder.
    mapping = {
        "system": {"mass": "m.mtx", "damping": "c.mtx", "stiffness": "k.mtx"},
        "sampling": {"samples": 64, "rate_hz": 100}, "outputs": [1],
        "excitation": {"dof": 1, "lines": "1:8", "amplitude": 1},
    }
    assert np.array_equal(mechid.simulate(mapping).displacement, other.displacement)


def record() -> tuple[Any, Any]:
    rig = np.loadtxt("examples/machine.csv", delimiter=",", skiprows=1)
    return rig[:, 1], rig[:, 2]


def test_series_of_other_labels_are_refused() -> None:
    pandas = pytest.importorskip("pandas")
    force, x = record()
    rows = np.arange(len(force))
    same = [pandas.Series(values, index=rows) for values in (force, x)]
    found = mechid.identify(*same, fs=128, period=256)
    assert found.parameters["m"].value == pytest.approx(25, rel=0.05)
    shuffled = pandas.Series(x[::-1], index=rows[::-1])
    later = pandas.Series(x, index=rows + 1)
    for other in (shuffled, later, same[1][1:]):
        with pytest.raises(ValueError, match="different indexes"):
            mechid.identify(same[0], other, fs=128, period=256)
        with pytest.raises(ValueError, match="different indexes"):
            table = {"f": same[0], "x": other}
            mechid.identify(table, force="f", displacement="x", fs=128, period=256)
    # Values without labels belong together by position.
    mechid.identify(same[0], later.to_numpy(), fs=128, period=256)


def test_xarray_of_other_labels_is_refused() -> None:
    xarray = pytest.importorskip("xarray")
    force, x = record()
    time = np.arange(len(force)) / 128
    first = xarray.DataArray(force, {"time": time}, ["time"])
    with pytest.raises(ValueError, match="different indexes"):
        mechid.identify(first, xarray.DataArray(x, {"time": time + 1}, ["time"]), fs=128, period=256)
    mechid.identify(first, xarray.DataArray(x, {"time": time}, ["time"]), fs=128, period=256)


def test_channels_that_begin_apart_are_refused() -> None:
    force, x = record()

    def channels(**fields: Any) -> list[dict[str, Any]]:
        common = {"fs": 128.0, "start_timestamp": "2024-01-01 00:00:00"}
        return [
            {"name": "f", "data": force, **common},
            {"name": "x", "data": x, **common, **fields},
        ]

    names = {"force": "f", "displacement": "x"}
    mechid.identify(channels(), **names, period=256)
    with pytest.raises(ValueError, match="begin at different instants"):
        mechid.identify(channels(start_timestamp="2024-01-01 00:00:01"), **names, period=256)
    with pytest.raises(ValueError, match="begin at different instants"):
        mechid.identify(channels(start_timestamp=None), **names, period=256)
    with pytest.raises(ValueError, match="several sampling rates"):
        mechid.identify(channels(fs=64.0), **names, period=256)
    for missing in ("name", "data"):
        broken = channels()
        del broken[1][missing]
        with pytest.raises(TypeError, match=missing):
            mechid.identify(broken, **names, period=256)
    instants = [{"name": n, "data": d, "time": np.arange(len(d)) / 128} for n, d in (("f", force), ("x", x))]
    assert mechid.identify(instants, **names, period=256).to_dict()["window"]["sample_rate_hz"] == 128
    del instants[1]["time"]
    with pytest.raises((TypeError, ValueError)):
        mechid.identify(instants, **names, period=256)


@pytest.mark.parametrize(
    "wrong",
    [
        {"fs": True}, {"fs": np.bool_(1)}, {"fs": "128"}, {"period": True}, {"threads": -1},
        {"threads": 2**70}, {"threads": 1.5}, {"fs": 10**400},
    ],
)
def test_wrong_arguments_are_of_this_package(wrong: dict[str, Any]) -> None:
    force, x = record()
    with pytest.raises((mechid.MechidError, TypeError)) as raised:
        mechid.identify(force, x, **{"fs": 128, "period": 256, **wrong})
    assert str(raised.value)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"threads": True}, "`threads` must be a whole number, got True"),
        ({"threads": "2"}, "`threads` must be a whole number, got '2'"),
        ({"unit": "g"}, "`unit` must be a mapping of names of columns"),
        ({"unit": {"x": 3}}, "`unit` of 'x' must be a text, got 3"),
        ({"scale": {"x": "two"}}, "`scale` of 'x' must be a number, got 'two'"),
        ({"scale": 2.0}, "`scale` must be a mapping of names of columns"),
        ({"time": 3}, "`time` must be a text, got 3"),
        ({"displacement": 2}, "`displacement` of a file or table must be the name of a column"),
    ],
)
def test_values_of_a_wrong_type_are_refused_in_a_sentence(wrong: dict[str, Any], said: str) -> None:
    force, x = record()
    table = {"f": force, "x": x}
    how = {"force": "f", "displacement": "x", "fs": 128, "period": 256, **wrong}
    with pytest.raises(TypeError, match=re.escape(said)):
        mechid.identify(table, **how)
    if "fs" in how:
        how["fs"] = None
    with pytest.raises(TypeError, match=re.escape(said)):
        mechid.identify("examples/machine.csv", **how)


def test_lines_to_skip_are_a_whole_number() -> None:
    with pytest.raises(TypeError, match="`skip_lines` must be a whole number, got 1.5"):
        mechid.identify("examples/machine.csv", force="force", displacement="displacement", skip_lines=1.5)


def test_a_rate_and_a_time_column_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    force, x = record()
    table = {"t": np.arange(len(x)) / 128, "f": force, "x": x}
    how = {"force": "f", "displacement": "x", "period": 256, "time": "t"}
    for fs in (128, 128.001, None):
        mechid.identify(table, **how, fs=fs)
    with pytest.raises(ValueError, match="128 Hz, and `fs` is 64 Hz"):
        mechid.identify(table, **how, fs=64)
    path = tmp_path / "a.csv"
    np.savetxt(path, np.transpose(list(table.values())), header="t,f,x", delimiter=",", comments="")
    mechid.identify(path, **how, fs=128)
    with pytest.raises(mechid.MechidError, match="says 128 Hz, and `fs` is 64 Hz"):
        mechid.identify(path, **how, fs=64)


def test_rates_of_sep_5_are_in_the_channels() -> None:
    force, x = record()
    channels: list[dict[str, Any]] = [{"name": "f", "data": force, "fs": 128}, {"name": "x", "data": x, "fs": 128}]
    how = {"force": "f", "displacement": "x", "period": 256}
    right = mechid.identify(channels, **how)
    for same in ({"channels": channels}, SimpleNamespace(channels=channels)):
        assert mechid.identify(same, **how).parameters["m"].value == right.parameters["m"].value
    with pytest.raises(ValueError, match="128 Hz, and `fs` is 64 Hz"):
        mechid.identify(channels, **how, fs=64)
    for channel in channels:
        channel["time"] = np.arange(len(x)) / 64
    with pytest.raises(ValueError, match=r"several sampling rates: \[64\.0, 128\.0\] Hz"):
        mechid.identify(channels, **how)
    channels = [{"name": "f", "data": force, "fs": "fast"}, {"name": "x", "data": x, "fs": 128}]
    with pytest.raises(TypeError, match="`fs` must be a number, got 'fast'"):
        mechid.identify(channels, **how)


def test_foreign_exceptions_do_not_come_through(tmp_path: Path) -> None:
    with pytest.raises(mechid.MechidError):
        mechid.multisine(-1, 100.0, amplitude=1)
    with pytest.raises(mechid.MechidError):
        fleet.run("examples/machine.csv", {"channels": {}}, tmp_path / "out", part_records=-1)
    with pytest.raises(mechid.MechidError, match=r"cannot read .*none\.json"):
        fleet.run("examples/machine.csv", tmp_path / "none.json", tmp_path / "out")
    with pytest.raises(mechid.MechidError):
        mechid.simulate("lone-\udcff.json")
    force, x = record()
    with pytest.raises(ValueError, match="longer than 4096 bytes"):
        mechid.Measurement.from_arrays(force, x, fs=128, name="n" * 5000)


ANALYSIS = {
    "channels": {"force": ["force"], "displacement": ["displacement"]},
    "window": {"period": 256},
}


@pytest.mark.skipif(sys.platform != "linux", reason="named pipes and limits of memory")
def test_a_poison_record_becomes_a_row(tmp_path: Path) -> None:
    day = tmp_path / "day"
    day.mkdir()
    (day / "well.csv").write_bytes(Path("examples/machine.csv").read_bytes())
    rows = b"".join(b"%d,1,2\n" % k for k in range(100))
    (day / "slow.csv").write_bytes(b"time,force,displacement\n" + rows)
    os.mkfifo(day / "pipe.csv")
    found = fleet.run(day, ANALYSIS, tmp_path / "well", record_seconds=60)
    assert (found.records, found.failed) == (2, 1)
    assert found.left_out == (f"{day}/pipe.csv (a named pipe)",)
    short = fleet.run(day, ANALYSIS, tmp_path / "short", record_seconds=1e-6)
    assert (short.failed, short.failures[0].code) == (2, "analysis.record-time")
    # If a process cannot start, no record is the cause.
    with pytest.raises(mechid.MechidError):
        fleet.run(day, ANALYSIS, tmp_path / "small", record_memory_gb=0.001)

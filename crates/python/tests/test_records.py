"""Records from every kind of source."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mechid

FILE = "examples/machine.csv"


def values(found: mechid.Identified) -> dict[str, float]:
    return {name: parameter.value for name, parameter in found.parameters.items()}


def test_mappings_and_sep_5_channels_are_records(columns: dict[str, np.ndarray]) -> None:
    named = mechid.identify(FILE, force="force", displacement="displacement", period=256)
    found = mechid.identify(columns, force="force", displacement="displacement", fs=128, period=256)
    assert values(found) == values(named)
    channels = [
        {"data": columns[name], "name": name, "unit_str": unit, "fs": 128.0, "type": "td"}
        for name, unit in (("force", "N"), ("displacement", "m"))
    ]
    found = mechid.identify(channels, force="force", displacement="displacement", period=256)
    assert values(found) == values(named)
    channels[1] |= {"data": columns["displacement"] * 1e6, "unit_str": "um"}
    found = mechid.identify(channels, force="force", displacement="displacement", period=256)
    for name, value in values(found).items():
        assert abs(value / values(named)[name] - 1) < 1e-9
    channels[1]["fs"] = 64.0
    with pytest.raises(ValueError, match="several sampling rates"):
        mechid.identify(channels, force="force", displacement="displacement", period=256)


def test_data_frames_are_records(columns: dict[str, np.ndarray]) -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(columns)
    named = mechid.identify(FILE, force="force", displacement="displacement", period=256)
    found = mechid.identify(frame, force="force", displacement="displacement", fs=128, period=256)
    assert values(found) == values(named)
    series = mechid.identify(frame["force"], frame["displacement"], fs=128, period=256)
    assert values(series) == values(named)


def test_xarray_datasets_are_records(columns: dict[str, np.ndarray]) -> None:
    xarray = pytest.importorskip("xarray")
    dataset = xarray.Dataset({name: ("time", data) for name, data in columns.items() if name != "time"})
    named = mechid.identify(FILE, force="force", displacement="displacement", period=256)
    found = mechid.identify(dataset, force="force", displacement="displacement", fs=128, period=256)
    assert values(found) == values(named)
    arrays = mechid.identify(dataset.force, dataset.displacement, fs=128, period=256)
    assert values(arrays) == values(named)


def test_a_measurement_tells_what_it_holds(columns: dict[str, np.ndarray]) -> None:
    record = mechid.Measurement.open(FILE, force="force", displacement="displacement", velocity="velocity")
    assert (record.name, record.fs, record.samples, len(record)) == (FILE, 128.0, 512, 512)
    assert record.channels["force"] == ["force"]
    np.testing.assert_array_equal(record.force[:, 0], columns["force"])
    assert set(record.responses) == {"displacement", "velocity"}
    window = record.window(start=11, period=100, periods=2)
    np.testing.assert_array_equal(window.responses["velocity"][:, 0], columns["velocity"][10:210])
    assert window.plan is not None and window.plan["window"] == {"start": 11, "period": 100, "periods": 2}
    assert mechid.Measurement.from_arrays(columns["force"], fs=1.0).plan is None


def test_what_comes_in_is_copied(columns: dict[str, np.ndarray]) -> None:
    force, x = columns["force"].copy(), columns["displacement"].copy()
    record = mechid.Measurement.from_arrays(force, x, fs=128, period=256)
    force[:], x[:] = 0.0, np.nan
    assert 24 < mechid.identify(record).parameters["m"].value < 26
    out = record.force
    out[:] = 0.0
    np.testing.assert_array_equal(record.force[:, 0], columns["force"])


def test_responses_of_arrays_and_of_a_file_are_one(tmp_path: Path) -> None:
    """The machine of a closed form, from arrays (exact to rounding) and from the text for the
    program."""
    omega = np.linspace(5.0, 90.0, 120)
    mass, damping, stiffness = np.diag([10.0, 6.0]), np.diag([30.0, 20.0]), np.array([[9e3, -4e3], [-4e3, 6e3]])
    dynamic = stiffness - omega[:, None, None] ** 2 * mass + 1j * omega[:, None, None] * damping
    response = -(omega[:, None, None] ** 2) * np.linalg.inv(dynamic)
    hz = omega / (2 * np.pi)
    table = mechid.ResponseTable(hz, response, quantity="acceleration", points=["x", "y"])
    found = mechid.identify_responses(table)
    np.testing.assert_allclose(found.mass, mass, atol=1e-9)
    np.testing.assert_allclose(found.damping, damping, atol=1e-7)
    np.testing.assert_allclose(found.stiffness, stiffness, rtol=1e-9, atol=1e-6)
    assert found.points == ("x", "y")
    assert found.settings["quantity"] is None
    np.testing.assert_allclose(found.machine().stiffness, found.stiffness)

    path = tmp_path / "h.csv"
    pairs = [(i, j) for i in range(2) for j in range(2)]
    names = [f"h_{'xy'[i]}_{'xy'[j]}" for i, j in pairs]
    head = ["frequency_hz", *(f"{name}_{part}" for name in names for part in ("real", "imag"))]
    columns = [hz, *(part for i, j in pairs for part in (response[:, i, j].real, response[:, i, j].imag))]
    rows = [",".join(head), *(",".join(map(repr, map(float, row))) for row in zip(*columns, strict=True))]
    path.write_text("\n".join(rows))
    read = mechid.identify_responses(path, quantity="acceleration")
    assert [p.value for p in read.parameters.values()] == [p.value for p in found.parameters.values()]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"response": np.ones((3, 2))}, "needs one entry, or one matrix"),
        ({"response": [1.0, 2.0, np.nan]}, "`response` has a value that is not finite"),
        ({"std_error": [0.1, 0.1]}, "`std_error` has the shape"),
        ({"coherence": np.ones((3, 2))}, "`coherence` of shape"),
        ({"response": [1.0, 2.0, 3.0]}, "`response` holds float64, one part or the magnitude"),
        ({"response": np.array([1, 2, 3])}, "give complex numbers, with real and imaginary parts"),
        ({"points": ["x", "y"]}, "2 names of points and 1 of forces, but `response` has 1 × 1"),
    ],
)
def test_responses_of_other_shapes_are_refused(arguments: dict[str, Any], said: str) -> None:
    given = {"response": [1.0 + 0j, 2.0, 3.0], **arguments}
    with pytest.raises(ValueError, match=re.escape(said)):
        mechid.ResponseTable([1.0, 2.0, 3.0], given.pop("response"), **given)

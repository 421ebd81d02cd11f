"""Measured beside modelled: receptances, residuals, and results as xarray datasets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import mechid

FILE, EXPERIMENT = "examples/machine.csv", "examples/machine.json"
COLUMNS: Any = {"force": "force", "displacement": "displacement"}
TWO = mechid.Machine(np.diag([2.0, 3.0]), [[4.0, 1.0], [-2.0, 5.0]], [[900.0, -200.0], [300.0, 700.0]])


def two_forces() -> tuple[mechid.Identified, np.ndarray, np.ndarray]:
    """A machine of two degrees of freedom, each excited on separate lines, and on line 40 by both
    forces."""
    first, second = (mechid.multisine(512, 32.0, lines=lines).force for lines in ("2:2:60,41", "3:2:61"))
    force = np.stack([first, second], axis=1)
    x = mechid.integrate(TWO, force, 32.0, scheme="exact", response="periodic")["displacement"]
    return mechid.identify(force, x, fs=32.0, period=512, lines="2:61"), force, x


def test_receptances_are_measured_where_one_force_acts() -> None:
    found, force, x = two_forces()
    table = found.frf
    lines = np.arange(2, 62)
    np.testing.assert_allclose(table.frequency_hz, lines / 16, rtol=1e-14)
    f, motion = (np.fft.rfft(values, axis=0)[lines] for values in (force, x))
    alone = np.array([[n % 2 == 0, n % 2 == 1 and n != 41] for n in lines])
    assert (np.isfinite(table.measured) == alone[:, np.newaxis, :]).all()
    for dof in (0, 1):
        judge = motion[alone[:, dof]] / f[alone[:, dof], dof, np.newaxis]
        np.testing.assert_allclose(table.measured[alone[:, dof], :, dof], judge, rtol=1e-9)
    omega = 2 * np.pi * table.frequency_hz[:, np.newaxis, np.newaxis]
    dynamic = found.stiffness - omega**2 * found.mass + 1j * omega * found.damping
    np.testing.assert_allclose(table.model, np.linalg.inv(dynamic), rtol=1e-9)
    with pytest.raises(ValueError, match="read-only"):
        table.model[0] = 0.0


@pytest.mark.parametrize(
    ("options", "segment"),
    [
        ({"velocity": "velocity", "domain": "time"}, 64),
        ({"from_frf": "h1", "segment": 128}, 128),
    ],
)
def test_receptances_of_open_records_are_those_of_segments(
    columns: dict[str, np.ndarray], options: Any, segment: int
) -> None:
    """Reference: H1 by SciPy from the same segments; by default, a segment is an eighth of the
    record."""
    signal = pytest.importorskip("scipy.signal")
    table = mechid.identify(FILE, **COLUMNS, **options).frf
    force, x = columns["force"], columns["displacement"]
    how = {"fs": 128.0, "nperseg": segment, "detrend": "constant"}
    hz, cross = signal.csd(force, x, **how)
    judge = dict(zip(hz, cross / signal.welch(force, **how)[1], strict=True))
    assert len(table.frequency_hz) > 5
    for frequency, measured in zip(table.frequency_hz, table.measured[:, 0, 0], strict=True):
        assert measured == pytest.approx(judge[round(frequency, 9)], rel=1e-9)


def test_a_residual_is_measured_minus_predicted(columns: dict[str, np.ndarray]) -> None:
    found = mechid.identify(FILE, **COLUMNS, period=256)
    left = found.residual["displacement"]
    x = columns["displacement"]
    spectrum = np.fft.rfft(columns["force"])
    omega = 2 * np.pi * np.fft.rfftfreq(len(x), 1 / 128.0)
    values = [found.parameters[name].value for name in ("m", "c", "k")]
    receptance = 1 / (values[2] - omega**2 * values[0] + 1j * omega * values[1])
    receptance[-1] = 0.0
    predicted = np.fft.irfft(spectrum * receptance)
    judge = (x - x.mean()) - (predicted - predicted.mean())
    np.testing.assert_allclose(left[:, 0], judge, atol=1e-12 * np.abs(x).max())


def test_an_identification_becomes_a_dataset() -> None:
    pytest.importorskip("xarray")
    found, _, _ = two_forces()
    dataset = found.to_xarray()
    measured, predicted = found.compared["displacement"]
    np.testing.assert_array_equal(dataset.displacement, measured)
    np.testing.assert_array_equal(dataset.displacement_residual, measured - predicted)
    assert dataset.displacement.dims == ("time", "dof") and dataset.displacement.units == "m"
    assert dataset.time.values[1] == 1 / 32 and list(dataset.dof.values) == [1, 2]
    at = dataset.frf.sel(frequency=2.0, motion=2, driven=1)
    assert complex(at) == found.frf.measured[30, 1, 0]
    np.testing.assert_array_equal(dataset.frf_model, found.frf.model)
    np.testing.assert_array_equal(dataset.stiffness, found.stiffness)
    k12 = dataset.sel(parameter="k12")
    assert float(k12.value) == found.parameters["k12"].value and str(k12.unit.values) == "N/m"
    variance = dataset.covariance.sel(parameter="k12", other_parameter="k12")
    assert float(k12.std_error) ** 2 == pytest.approx(float(variance), rel=1e-12)


def test_other_results_become_datasets() -> None:
    pytest.importorskip("xarray")
    table = mechid.frf(FILE, **COLUMNS, period=256)
    dataset = table.to_xarray()
    np.testing.assert_array_equal(dataset.response.sel(motion=1, force=1), table.response())
    np.testing.assert_array_equal(dataset.coherence.sel(motion=1), table.coherence())
    assert dataset.response.units == "m/N" and dataset.attrs["record"] == FILE

    found = mechid.identify(FILE, **COLUMNS, period=256)
    force = mechid.reconstruct(found, FILE, displacement="displacement", period=256)
    dataset = force.to_xarray()
    np.testing.assert_array_equal(dataset.force, force.force)
    np.testing.assert_array_equal(dataset.std_error, force.std_error)
    np.testing.assert_array_equal(dataset.spectrum, force.spectrum[1])
    np.testing.assert_array_equal(dataset.time, force.time)

    run = mechid.simulate(EXPERIMENT)
    dataset = run.to_xarray()
    np.testing.assert_array_equal(dataset.velocity, run.velocity)
    np.testing.assert_array_equal(dataset.velocity_truth, run.truth["velocity"])

    sweep = mechid.sweep(EXPERIMENT, npi=[2, 4, 8])
    dataset = sweep.to_xarray()
    np.testing.assert_array_equal(dataset.error.sel(setting=[2, 4, 8]), sweep.error)
    at = next(p for p in sweep.points[1]["parameters"] if p["name"] == "k")
    assert float(dataset.k.sel(setting=4)) == at["value"] and dataset.k.units == "N/m"

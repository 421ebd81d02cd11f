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
    """A machine of two degrees of freedom, each driven on lines of its own, and line 40 by both."""
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
    "options",
    [
        {"period": 256},
        {"velocity": "velocity", "domain": "time"},
        {"from_frf": "h1", "segment": 128},
    ],
)
def test_every_fit_has_a_receptance_and_a_residual(options: Any) -> None:
    found = mechid.identify(FILE, **COLUMNS, **options)
    table = found.frf
    near = (table.frequency_hz > 8) & (table.frequency_hz < 11)
    assert near.any() and np.isfinite(table.measured[near]).all()
    # Windows and noise are felt less away from the resonance.
    np.testing.assert_allclose(table.measured[near], table.model[near], rtol=0.1)
    measured, predicted = found.compared["displacement"]
    np.testing.assert_array_equal(found.residual["displacement"], measured - predicted)


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

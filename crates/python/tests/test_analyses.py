"""The other analyses: exactly equal to the program, and compared with closed forms."""

from __future__ import annotations

import json
import re
import typing
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mechid
from mechid._analyses import Scheme

FILE, EXPERIMENT = "examples/machine.csv", "examples/machine.json"
COLUMNS = {"force": "force", "displacement": "displacement"}
ONE = mechid.Machine(25.0, 188.5, 142_122.0)
TWO = mechid.Machine(np.diag([2.0, 3.0]), [[4.0, 1.0], [-2.0, 5.0]], [[900.0, -200.0], [300.0, 700.0]])


def words(options: dict[str, Any]) -> list[str]:
    told = []
    for name, value in options.items():
        if value is True:
            told.append(f"--{name.replace('_', '-')}")
            continue
        if isinstance(value, tuple):
            value = ":".join(str(part) for part in value)
        if isinstance(value, list):
            value = ",".join(str(part) for part in value)
        told += [f"--{name.replace('_', '-')}", str(value)]
    return told


@pytest.mark.parametrize(
    "options",
    [
        {"period": 256},
        {"period": 256, "estimator": "hv", "band_hz": (5, 20)},
        {"segment": "128:66:blackman", "estimator": "h2"},
        {"period": 128, "lines": "odd"},
    ],
)
def test_frequency_responses_are_those_of_the_program(
    program: Callable[..., str], options: dict[str, Any]
) -> None:
    told = program("frf", FILE, *words({**COLUMNS, **options}), "--json")
    found = mechid.frf(FILE, **COLUMNS, **options)
    assert found.to_json() + "\n" == told
    assert found.response().dtype == complex and found.coherence().shape == found.frequency_hz.shape
    assert found.pairs == ((1, 1),) and (found.std_error() >= 0).all()
    with pytest.raises(KeyError):
        found.response(2, 1)


@pytest.mark.parametrize("options", [{}, {"modes": 2}, {"from_s": 0.3, "to_s": 2.0, "max_modes": 4}])
def test_a_free_decay_is_that_of_the_program(program: Callable[..., str], options: dict[str, Any]) -> None:
    file = "examples/decay.csv"
    channels = {"acceleration": ["a1", "a2", "a3"]}
    spelled = {name.removesuffix("_s"): value for name, value in options.items()}
    told = program("modes", file, *words({**channels, **spelled}), "--json")
    found = mechid.decay(file, **channels, **options)
    assert found.to_json() + "\n" == told
    assert len(found.modes) == options.get("modes", 3) == len(found.amplitudes) == len(found.decays)
    assert found.modes[0].shape.shape == (3,) and found.explained.shape == (3,)
    assert found.energy_shares.sum() == pytest.approx(1)


def test_modes_of_a_roving_hammer_are_those_of_the_program(program: Callable[..., str]) -> None:
    files = ["examples/hammer-1.csv", "examples/hammer-2.csv"]
    words_of_program = "--force force --force-at 1,2 --acceleration a1 --response-at 1 --hits --band-hz 2:100"
    told = program("modes", *files, *words_of_program.split(), "--json")
    found = mechid.modes(
        *files,
        force="force",
        acceleration="a1",
        force_at=[1, 2],
        response_at=[1],
        hits=True,
        band_hz=(2, 100),
    )
    assert found.to_json() + "\n" == told
    first, second = (mode.natural_frequency_hz.value for mode in found.modes)
    # The modes of the machine of the example, in closed form.
    assert first == pytest.approx(12, rel=1e-4) and second == pytest.approx(31, rel=1e-4)
    assert found.participations.shape == (2, 2) and found.explained[0] > 0.99
    assert np.all(found.driven_shares > 0.98) and found.mac.shape == (2, 2)


def test_modes_of_a_table_are_those_of_the_program(program: Callable[..., str], tmp_path: Path) -> None:
    """Reference: two modes in closed form, as arrays and as a file."""
    hz = np.arange(5, 60, 0.05)
    s = 2j * np.pi * hz
    shapes = np.array([[1.0, 0.8], [-0.6, 1.0]])
    omega, zeta = 2 * np.pi * np.array([12.0, 31.0]), np.array([0.01, 0.02])
    gains = 1 / (s[:, None] ** 2 + 2 * zeta * omega * s[:, None] + omega**2)
    exact = np.einsum("kr,ri,rj->kij", gains, shapes, shapes[:, :1])
    rng = np.random.default_rng(3)
    noise = rng.normal(size=exact.shape) + 1j * rng.normal(size=exact.shape)
    response = exact + 1e-6 * noise
    table = mechid.ResponseTable(hz, response, quantity="displacement")
    found = mechid.modes(table, diagrams=True)
    for mode, truth, ratio in zip(found.modes, [12.0, 31.0], zeta, strict=True):
        assert abs(mode.natural_frequency_hz.value - truth) < 1e-3
        assert mode.damping_ratio.value == pytest.approx(ratio, rel=0.01)
    assert found.diagrams is not None and len(found.diagrams["mode_indicator"]["singular_values"]) == 1
    assert {check["code"] for check in found.checks} >= {"driving_point", "explained"}
    names = ["h_1_1_real", "h_1_1_imaginary", "h_2_1_real", "h_2_1_imaginary"]
    columns = np.column_stack([hz, *(part for i in (0, 1) for part in (response[:, i, 0].real, response[:, i, 0].imag))])
    path = tmp_path / "table.csv"
    np.savetxt(path, columns, delimiter=",", header=",".join(["frequency_hz", *names]), comments="", fmt="%.17g")
    told = program("modes", str(path), "--quantity", "displacement", "--json")
    assert mechid.modes(path, quantity="displacement").to_json() + "\n" == told


def test_a_comparison_is_that_of_the_program(program: Callable[..., str], tmp_path: Path) -> None:
    options: dict[str, Any] = {"force": "force", "acceleration": "a1,a2", "hits": True, "band_hz": (2, 100)}
    first, second = (
        mechid.modes(f"examples/hammer-{k}.csv", **{**options, "acceleration": ["a1", "a2"]}) for k in (1, 2)
    )
    path = tmp_path / "second.json"
    path.write_text(second.to_json(), encoding="utf-8")
    found = mechid.compare_modes(first, path)
    assert [(pair["first"], pair["second"]) for pair in found.pairs] == [(1, 1), (2, 2)]
    assert found.mac.shape == (2, 2) and found.points == ("a1", "a2")
    assert found.only_first == found.only_second == () and "MAC" in str(found)
    told = program("modes", "examples/hammer-1.csv", *words(options), "--compare", str(path), "--json")
    assert json.loads(told)["pairs"] == json.loads(found.to_json())["pairs"]
    # A model given as arrays; one of its modes is 5 % higher.
    model = {"natural_frequency_hz": [12.0, 31.0 * 1.05], "shape": [[1, 0.57], [0.83, -1]], "points": ["a1", "a2"]}
    changed = mechid.compare_modes(first, model).pairs[1]["natural_frequency_hz"]
    assert changed["difference"] == pytest.approx(0.05 * 31, rel=1e-2) and changed["p_value"] < 1e-6
    with pytest.raises(ValueError, match="`shape` has the shape"):
        mechid.compare_modes(first, {"natural_frequency_hz": [1.0], "shape": [1.0]})
    with pytest.raises(TypeError, match="modes must be a result"):
        mechid.compare_modes(first, 3)


def test_a_free_decay_of_arrays_is_found() -> None:
    t = np.arange(800) / 200
    omega, zeta = 2 * np.pi * 7, 0.01
    x = np.exp(-zeta * omega * t) * np.cos(omega * np.sqrt(1 - zeta**2) * t)
    noise = np.random.default_rng(1).normal(scale=0.01, size=(800, 2))
    found = mechid.decay(displacement=np.column_stack([x, -0.5 * x]) + noise, fs=200, from_s=0)
    (mode,) = found.modes
    low, high = mode.natural_frequency_hz.interval or (0, 0)
    assert low < 7.002 and high > 6.998 and abs(mode.shape[1] + 0.5) < 0.01
    again = mechid.decay(displacement=np.column_stack([x, -0.5 * x]) + noise, fs=200, settings=found.settings)
    assert again.to_json() == found.to_json()


RIG = {"force": ["fx", "fy"], "acceleration": ["ax", "ay"], "displacement": ["dx", "dy"]}


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"coefficients": "eight", "band_hz": (20, 150), "without_hz": ["60:multiples"]},
        {"load": 2500.0, "clearance": 1e-4, "diameter": 0.1, "length": 0.05, "viscosity": 0.02},
    ],
)
def test_a_bearing_is_that_of_the_program(program: Callable[..., str], options: dict[str, Any]) -> None:
    wet, dry = "examples/bearing-rig.csv", "examples/bearing-dry.csv"
    every = {**RIG, "period": 256, "stator_mass": 20.0, "rotation_hz": 50.0, **options}
    told = program("bearing", wet, "--baseline", dry, *words(every), "--json")
    if "without_hz" in every:
        every["without_hz"] = [{"frequency_hz": 60.0, "multiples": True}]
    found = mechid.bearing(wet, baseline=dry, **every)
    assert found.to_json() + "\n" == told
    assert found.to_svg().startswith("<svg") and "kxy" in str(found) and "kxx=" in repr(found)
    assert found.covariance.shape == (len(found.coefficients),) * 2
    np.testing.assert_array_equal(found.stiffness[0, 1], found.coefficients["kxy"].value)
    np.testing.assert_array_equal(found.mass == 0, np.full((2, 2), "mxx" not in found.coefficients))
    ratio, mass = found.whirl_frequency_ratio, found.critical_mass
    assert ratio is not None and 0.4 < ratio.value < 0.6 and mass is not None and mass.value > 1000
    assert (found.dimensionless is None) == ("load" not in options)
    again = mechid.bearing(
        mechid.Measurement.open(wet, **RIG, period=256),
        baseline=[mechid.Measurement.open(dry, **RIG, period=256)],
        settings=found.settings,
    )
    assert again.to_json() == found.to_json()


def test_a_bearing_comes_from_frequency_responses(tmp_path: Path) -> None:
    """Closed-form responses of a housing on a film and on stingers; the baseline has only the
    stingers."""
    omega = 2 * np.pi * np.arange(24.0, 200.0, 4.0)[:, None, None]
    film = [np.array(m) for m in ([[7e7, 9e7], [-1.6e7, 4e7]], [[5e5, 1.5e5], [1.4e5, 2e5]], [[3.0, 1.0], [-1.0, 2.0]])]
    stinger = [np.diag([6e6, 5e6]), np.diag([2e3, 1.5e3]), 0.4 * np.eye(2)]

    def tables(*parts: list[np.ndarray]) -> list[mechid.ResponseTable]:
        k, c, m = (sum(part[kind] for part in parts) for kind in range(3))
        receptance = np.linalg.inv(k - omega**2 * (m + 20.0 * np.eye(2)) + 1j * omega * c)
        hz = omega.ravel() / (2 * np.pi)
        return [
            mechid.ResponseTable(hz, receptance, quantity="displacement"),
            mechid.ResponseTable(hz, -(omega**2) * receptance, quantity="acceleration"),
        ]

    wet, dry = tables(film, stinger), tables(stinger)
    found = mechid.bearing(*wet, baseline=dry, stator_mass=20, rotation_hz=50, coefficients="twelve")
    for matrix, exact in zip((found.stiffness, found.damping, found.mass), film, strict=True):
        np.testing.assert_allclose(matrix, exact, atol=1e-8 * np.abs(exact).max())
    assert found.settings["points"] == [] and "neither standard errors" in found.remarks[0]
    with pytest.raises(mechid.MechidError, match="a test needs two tables"):
        mechid.bearing(wet[0], stator_mass=20)
    with pytest.raises(TypeError, match="`period` belongs to records"):
        mechid.bearing(*wet, stator_mass=20, period=256)
    with pytest.raises(mechid.MechidError, match="stator_mass"):
        mechid.bearing(*wet)


def test_a_frequency_response_is_the_ratio_of_spectra(columns: dict[str, np.ndarray]) -> None:
    found = mechid.frf(columns["force"], columns["displacement"], fs=128, period=256, lines="4:60")
    force, x = (
        np.fft.rfft(columns[name].reshape(2, 256), axis=1)[:, 4:61] for name in ("force", "displacement")
    )
    h1 = (x * force.conj()).sum(axis=0) / (np.abs(force) ** 2).sum(axis=0)
    np.testing.assert_allclose(found.response(), h1, rtol=1e-9)
    np.testing.assert_allclose(found.frequency_hz, np.arange(4, 61) / 2, rtol=1e-14)


@pytest.mark.parametrize(
    "options",
    [
        {"displacement": "displacement", "period": 256},
        {"displacement": "displacement", "period": 256, "method": "tikhonov", "rule": "gcv"},
        {"displacement": "displacement", "period": 256, "lines": "4:60", "noise": [2e-6]},
        {"displacement": "displacement", "velocity": "velocity", "method": "discretised"},
        {"displacement": "displacement", "velocity": "velocity", "acceleration": "acceleration",
         "method": "continuous", "forced": [1]},
        {"displacement": "displacement", "method": "kalman", "at_rest": True},
    ],
)
def test_forces_are_those_of_the_program(
    program: Callable[..., str], tmp_path: Path, options: dict[str, Any]
) -> None:
    machine = tmp_path / "found.json"
    identified = mechid.identify(FILE, **COLUMNS, period=256, method="maximum-likelihood")
    machine.write_text(identified.to_json(), encoding="utf-8")
    table = tmp_path / "force.csv"
    told = program("force", FILE, "--system", machine, *words(options), "--json", "--output", table)
    found = mechid.reconstruct(machine, FILE, **options)
    assert found.to_dict() == json.loads(told)
    written = np.loadtxt(table, delimiter=",", skiprows=1, ndmin=2)
    np.testing.assert_array_equal(found.force[:, 0], written[:, 1])
    np.testing.assert_array_equal(found.time, written[:, 0])
    if found.std_error is not None:
        np.testing.assert_array_equal(found.std_error[:, 0], written[:, 2])
    frequency, amplitudes = found.spectrum
    assert len(frequency) == len(amplitudes)
    # The identification itself serves as the machine, because its JSON preserves every bit.
    again = mechid.reconstruct(identified, FILE, **options)
    np.testing.assert_array_equal(again.force, found.force)


@pytest.mark.parametrize("options", [{"npi": [2, 4, 8]}, {"rate_hz": [64, 128], "estimator": "held"}])
def test_sweeps_are_those_of_the_program(program: Callable[..., str], options: dict[str, Any]) -> None:
    told = program("sweep", EXPERIMENT, *words(options), "--json")
    steps: list[int] = []
    found = mechid.sweep(EXPERIMENT, **options, progress=steps.append)
    assert found.to_json() + "\n" == told
    values = next(iter(options.values())) if "npi" in options else options["rate_hz"]
    np.testing.assert_array_equal(found.values, values)
    assert steps[-1] == len(values) and found.best in values and found.error.shape == found.values.shape
    described = json.loads(Path(EXPERIMENT).read_text(encoding="utf-8"))
    again = mechid.sweep(described, settings=found.settings)
    assert [p["error"] for p in again.points] == [p["error"] for p in found.points]


def test_a_record_is_swept_as_the_program_does(program: Callable[..., str]) -> None:
    options: dict[str, Any] = {**COLUMNS, "velocity": "velocity", "decimate": [1, 2, 4]}
    told = program("sweep", FILE, *words(options), "--reference", EXPERIMENT, "--json")
    assert mechid.sweep(FILE, **options, reference=EXPERIMENT).to_json() + "\n" == told


def test_failing_progress_ends_a_sweep() -> None:
    def fail(_: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        mechid.sweep(EXPERIMENT, npi=[2, 4], progress=fail)


def test_an_inventory_is_that_of_the_program(program: Callable[..., str]) -> None:
    assert mechid.inspect(FILE).to_json() + "\n" == program("info", FILE, "--json")
    found = mechid.inspect(FILE, columns=["force"], period=256, curves=True)
    assert found.fs == 128.0 and found.channels[0]["period"]["samples"] == 256
    assert found.to_svg().startswith("<svg")


def test_modes_are_those_of_the_program(program: Callable[..., str]) -> None:
    machine = mechid.Machine.read(EXPERIMENT)
    assert machine.to_json() + "\n" == program("modes", EXPERIMENT, "--json")
    assert str(machine) == program("modes", EXPERIMENT)


def test_modes_of_a_machine_that_is_not_symmetric_are_those_of_numpy() -> None:
    a, _, _, _ = TWO.state_space()
    judge = np.linalg.eigvals(a)
    judge = np.sort_complex(judge[judge.imag > 0])
    found = np.sort_complex(np.array([mode.eigenvalue for mode in TWO.modes]))
    np.testing.assert_allclose(found, judge, rtol=1e-10)
    omega = 17.0
    dynamic = TWO.stiffness - omega**2 * TWO.mass + 1j * omega * TWO.damping
    receptance = TWO.receptance(omega / (2 * np.pi))
    np.testing.assert_allclose(receptance, [np.linalg.inv(dynamic)], rtol=1e-12)
    assert TWO.receptance([1.0, 2.0, 3.0]).shape == (3, 2, 2)


def test_simulations_are_those_of_the_program(program: Callable[..., str], tmp_path: Path) -> None:
    table = tmp_path / "record.csv"
    program("simulate", EXPERIMENT, "--output", table)
    written = np.loadtxt(table, delimiter=",", skiprows=1)
    found = mechid.simulate(EXPERIMENT)
    for column, name in enumerate(("force", "displacement", "velocity", "acceleration"), 1):
        np.testing.assert_array_equal(getattr(found, name)[:, 0], written[:, column])
    assert not np.array_equal(found.truth["displacement"], found.displacement)
    record = found.measurement("displacement", "velocity", period=256)
    identified = mechid.identify(record, method="maximum-likelihood")
    assert abs(identified.parameters["m"].value / 25 - 1) < 0.01


SCHEMES = [
    "newmark", "central-difference", "houbolt", "wilson-theta", "generalised-alpha", "hht-alpha",
    "wbz-alpha", "bathe", "rho-infinity-bathe", "matrix-exponential", "runge-kutta-4",
]


@pytest.mark.parametrize("scheme", [*SCHEMES, {"name": "newmark", "beta": 0.3, "gamma": 0.6}])
@pytest.mark.parametrize("response", ["from-rest", "periodic"])
def test_integration_is_that_of_a_simulation(scheme: Any, response: str) -> None:
    named = {"name": scheme} if isinstance(scheme, str) else scheme
    if scheme in ("matrix-exponential", "runge-kutta-4"):
        named = {"name": scheme, "load": "linear"}
    described = {
        "system": {"mass": 25.0, "damping": 188.5, "stiffness": 142122.0},
        "sampling": {"samples": 512, "rate_hz": 400.0},
        "excitation": [{"lines": "1:20", "amplitude": 2.0}],
        "scheme": named,
        "response": response,
    }
    run = mechid.simulate(described)
    found = mechid.integrate(ONE, run.force, run.fs, scheme=scheme, response=response)  # type: ignore[arg-type]
    for name in ("displacement", "velocity", "acceleration"):
        np.testing.assert_array_equal(found[name], run.truth[name])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_free_motion_is_the_closed_form(scheme: Any) -> None:
    fs, n, x0, v0 = 4000.0, 2000, 1e-3, 0.02
    found = mechid.integrate(ONE, np.zeros(n), fs, scheme=scheme, displacement=x0, velocity=v0)
    t = np.arange(n) / fs
    sigma, omega_n = 188.5 / 50.0, np.sqrt(142_122.0 / 25.0)
    omega_d = np.sqrt(omega_n**2 - sigma**2)
    sine = (v0 + sigma * x0) / omega_d
    truth = np.exp(-sigma * t) * (x0 * np.cos(omega_d * t) + sine * np.sin(omega_d * t))
    assert np.abs(found["displacement"][:, 0] - truth).max() < 2e-3 * x0


def chain(dof: int, damping: float) -> dict[str, Any]:
    """M, C and K of masses between walls, as SciPy's sparse matrices; C is not symmetric."""
    sparse = pytest.importorskip("scipy.sparse")

    def band(under: float, on: float, over: float) -> Any:
        return sparse.diags([under, on, over], [-1, 0, 1], shape=(dof, dof), format="csc")

    return {"mass": band(0.0, 2.0, 0.0), "damping": band(-0.2, damping, -0.1), "stiffness": band(-900.0, 1900.0, -900.0)}


@pytest.mark.parametrize("scheme", ["exact", "bathe"])
def test_a_large_machine_is_three_sparse_matrices(scheme: str) -> None:
    matrices, fs, samples = chain(1000, 40.0), 64.0, 512
    found = mechid.simulate(
        {
            "system": matrices,
            "sampling": {"samples": samples, "rate_hz": fs},
            "excitation": [{"lines": "1,2,7", "amplitude": 5.0, "dof": 3}],
            "outputs": [4, 1],
            "scheme": {"name": scheme},
        }
    )
    assert found.force.shape == (samples, 1) and found.displacement.shape == (samples, 2)
    # Reference: the receptance at each line, by SciPy.
    solve = pytest.importorskip("scipy.sparse.linalg").spsolve
    m, c, k = (matrices[name] for name in ("mass", "damping", "stiffness"))
    forces, lines = np.fft.rfft(found.force[:, 0]), np.zeros((samples // 2 + 1, 2), complex)
    for line in (1, 2, 7):
        omega = 2 * np.pi * line * fs / samples
        load = np.zeros(1000, complex)
        load[2] = forces[line]
        lines[line] = solve((k - omega**2 * m + 1j * omega * c).tocsc(), load)[[3, 0]]
    truth = np.fft.irfft(lines, samples, axis=0)
    error = np.abs(found.displacement - truth).max() / np.abs(truth).max()
    assert error < (1e-12 if scheme == "exact" else 5e-4)
    with pytest.raises(ValueError, match="sparse matrices"):
        found.machine  # noqa: B018


def test_modes_of_a_large_machine() -> None:
    matrices = chain(500, 1.0)
    found = mechid.selected_modes(**matrices, count=4)
    near = mechid.selected_modes(*matrices.values(), 3, near_hz=8.0)
    # Reference: all eigenvalues, by NumPy.
    m, c, k = (matrix.toarray() for matrix in matrices.values())
    rate = np.block([[np.zeros((500, 500)), np.eye(500)], [-k / m[0, 0], -c / m[0, 0]]])
    all_of_them = np.linalg.eigvals(rate)
    all_of_them = all_of_them[all_of_them.imag > 0]
    lowest = all_of_them[np.argsort(np.abs(all_of_them))][:4]
    np.testing.assert_allclose(found.eigenvalue, lowest, rtol=1e-8)
    np.testing.assert_allclose(found.natural_frequency_hz, np.abs(lowest) / (2 * np.pi), rtol=1e-8)
    nearest = all_of_them[np.argsort(np.abs(all_of_them - 16j * np.pi))][:3]
    np.testing.assert_allclose(np.sort(near.eigenvalue.imag), np.sort(nearest.imag), rtol=1e-8)
    for value, shape in zip(found.eigenvalue, found.shape.T, strict=True):
        left = np.abs((value**2 * m + value * c + k) @ shape).max()
        assert left < 1e-10 * np.abs(k).max() and np.abs(shape).max() == pytest.approx(1.0)
    assert (found.damping_ratio > 0).all() and not found.is_rigid_body.any()
    assert found.residual.max() < 1e-12 and "mode" in str(found)
    with pytest.raises(mechid.MechidError, match="3"):
        mechid.selected_modes(np.eye(3), np.eye(2), np.eye(3), 1)
    with pytest.raises(ValueError, match="square"):
        mechid.selected_modes(matrices["mass"][:3], *list(matrices.values())[1:], count=1)


def test_predictions_are_exact_between_samples() -> None:
    linalg = pytest.importorskip("scipy.linalg")
    rng = np.random.default_rng(3)
    force, fs = rng.standard_normal((300, 2)), 50.0
    a, b, c, _ = TWO.state_space()
    # Reference: the matrix exponential of the state with the force and its slope.
    n, m = b.shape
    augmented = np.zeros((n + 2 * m, n + 2 * m))
    augmented[:n, :n], augmented[:n, n : n + m] = a, b
    augmented[n : n + m, n + m :] = np.eye(m)
    step = linalg.expm(augmented / fs)
    state, rows = np.zeros(n), []
    for k, now in enumerate(force):
        rows.append(c @ state)
        slope = (force[k + 1] - now) * fs if k + 1 < len(force) else np.zeros(m)
        state = (step @ np.concatenate([state, now, slope]))[:n]
    found = mechid.predict(TWO, force, fs)["displacement"]
    np.testing.assert_allclose(found, rows, atol=1e-12 * np.abs(rows).max(), rtol=1e-9)


@pytest.mark.parametrize(
    "options",
    [
        {"lines": "1:2:63"},
        {"lines": "2:40", "phases": "schroeder-binary", "amplitude": 3.0},
        {"lines": "2:40", "phases": "random", "rms": 10.0, "seed": 5},
        {"lines": "1:12", "phases": "low-crest", "peak": 20.0, "starts": 2},
    ],
)
def test_multisines_are_those_of_the_program(
    program: Callable[..., str], tmp_path: Path, options: dict[str, Any]
) -> None:
    table = tmp_path / "force.csv"
    told = json.loads(
        program("multisine", "--samples", 256, "--rate", 100, *words(options), "--output", table, "--json")
    )["channels"][0]
    found = mechid.multisine(256, 100.0, **options)
    np.testing.assert_array_equal(found.force, np.loadtxt(table, delimiter=",", skiprows=1)[:, 1])
    assert list(found.lines) == told["lines"] and found.crest_factor == told["crest_factor"]
    t = np.arange(256) / 256
    cosines = np.cos(2 * np.pi * np.outer(t, found.lines) + found.phases)
    np.testing.assert_allclose(found.force, cosines @ found.amplitudes, atol=1e-9 * found.peak)


def test_results_are_drawn_and_reported(tmp_path: Path) -> None:
    found = mechid.identify(FILE, **COLUMNS, period=256, method="maximum-likelihood")
    page = found.report(tmp_path / "report.html", title="<rig>", reconstruct_force=True)
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == page
    assert page.startswith("<!DOCTYPE html>") and "&lt;rig&gt;" in page
    results = [
        found, found.machine(), mechid.frf(FILE, **COLUMNS, period=256),
        mechid.reconstruct(found, FILE, displacement="displacement", period=256),
        mechid.sweep(EXPERIMENT, npi=[2, 4]),
    ]
    for result in results:
        html = result._repr_html_()
        assert 'sandbox="allow-scripts"' in html and "&lt;svg" in html and "<pre>" in html
        assert "<script" not in html and repr(result).startswith("<")
    measured, predicted = found.compared["displacement"]
    assert np.linalg.norm(measured - predicted) < 0.02 * np.linalg.norm(measured)


def test_plots_go_into_the_axes_given() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("svg")
    from matplotlib import pyplot

    from mechid import plotting

    found = mechid.identify(FILE, **COLUMNS, period=256)
    table = mechid.frf(FILE, **COLUMNS, period=256)
    force = mechid.reconstruct(found, FILE, displacement="displacement", period=256)
    for plot, result in [
        (plotting.receptance, found), (plotting.response, found), (plotting.frf, table),
        (plotting.coherence, table), (plotting.force, force), (plotting.modes, found),
        (plotting.shape, found), (plotting.assurance, found),
        (plotting.sweep, mechid.sweep(EXPERIMENT, npi=[2, 4])),
    ]:
        figure, ax = pyplot.subplots()
        assert plot(result, ax=ax) is ax and (ax.lines or ax.images) and ax.get_xlabel()
        pyplot.close(figure)
    ax = plotting.receptance(found, phase=True)
    assert "°" in ax.get_ylabel()
    pyplot.close("all")
    in_time = mechid.identify(FILE, **COLUMNS, velocity="velocity", domain="time")
    assert plotting.receptance(in_time).lines
    pyplot.close("all")


def test_plots_show_modes_and_bearings() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("svg")
    from matplotlib import pyplot

    from mechid import plotting

    hits: dict[str, Any] = {"force": "force", "acceleration": ["a1", "a2"], "hits": True, "band_hz": (2, 100)}
    found = mechid.modes("examples/hammer-1.csv", **hits, diagrams=True)
    ax = plotting.stabilisation(found)
    drawn = {line.get_label(): line.get_xdata() for line in ax.lines}
    assert found.diagrams is not None
    stable = np.array(found.diagrams["stabilisation"]["is_stable"])
    assert len(drawn["stable"]) == stable.sum() and len(drawn["not stable"]) == (~stable).sum()
    for mode in found.modes:
        assert np.abs(drawn["stable"] - mode.natural_frequency_hz.value).min() < 0.1
    assert plotting.shape(found, 2).lines and plotting.assurance(found).images
    with pytest.raises(ValueError, match="diagrams=True"):
        plotting.stabilisation(mechid.modes("examples/hammer-1.csv", **hits))
    pyplot.close("all")
    bearing = mechid.bearing(
        "examples/bearing-rig.csv", baseline="examples/bearing-dry.csv",
        **RIG, period=256, stator_mass=20.0, rotation_hz=50.0,
    )
    ax = plotting.dynamic_stiffness(bearing, force=1, motion=2)
    real, imaginary = (line for line in ax.lines if len(line.get_xdata()) and line.get_marker() == "None")
    np.testing.assert_allclose(imaginary.get_ydata(), 2 * np.pi * imaginary.get_xdata() * bearing.damping[0, 1])
    rows = bearing.to_dict()["dynamic_stiffness"]
    errors = np.array([row["standard_error_real"][1] for row in rows])
    distance = np.abs(np.array([row["real"][1] for row in rows]) - real.get_ydata())
    assert np.mean(distance < 3 * errors) > 0.95 and len(ax.containers) == 2
    with pytest.raises(IndexError, match="not 3"):
        plotting.dynamic_stiffness(bearing, force=3)
    pyplot.close("all")


@pytest.mark.parametrize("options", [{"period": 256}, {"settle": 40}, {}])
def test_predictions_are_those_of_the_program(
    program: Callable[..., str], tmp_path: Path, options: dict[str, Any]
) -> None:
    machine = tmp_path / "found.json"
    identified = mechid.identify(FILE, **COLUMNS, period=256, nonlinear="k3: x1^3")
    assert identified.nonlinear is not None and identified.nonlinear["terms"] == "k3: x1^3"
    machine.write_text(identified.to_json(), encoding="utf-8")
    table = tmp_path / "predicted.csv"
    told = program("predict", machine, FILE, *words({**COLUMNS, **options}), "--json", "--output", table)
    found = mechid.Machine.read(machine).predict(FILE, **COLUMNS, **options)
    assert found.to_json() + "\n" == told and str(found)
    written = np.loadtxt(table, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(found.displacement[:, 0], written[:, 1])
    assert found.channels[0]["nrmse"] == json.loads(told)["channels"][0]["nrmse"]
    again = identified.machine().predict(FILE, **COLUMNS, **options)
    np.testing.assert_array_equal(again.velocity, found.velocity)


def test_modes_predict_and_find_forces_as_those_of_the_program(
    program: Callable[..., str], tmp_path: Path
) -> None:
    responses: dict[str, Any] = {"acceleration": ["a1", "a2"]}
    hits: dict[str, Any] = {"force": "force", "hits": True, "band_hz": (2, 100), **responses}
    modes = mechid.modes("examples/hammer-1.csv", **hits)
    path = tmp_path / "modes.json"
    path.write_text(modes.to_json(), encoding="utf-8")
    columns: dict[str, Any] = {"force": "force", **responses}
    options = {"settle": 200, **columns}
    told = program("predict", path, "examples/hammer-1.csv", *words(options), "--json")
    predicted = modes.predict("examples/hammer-1.csv", **options)
    assert json.loads(predicted.to_json())["channels"] == json.loads(told)["channels"]
    rest = modes.predict("examples/hammer-1.csv", **columns)
    assert any("begins at rest" in remark for remark in rest.remarks)
    for fitted, unfitted in zip(predicted.channels, rest.channels, strict=True):
        assert fitted["nrmse"] < 0.5 * unfitted["nrmse"]
    assert list(predicted.columns) == ["a1", "a2"]
    with pytest.raises(mechid.MechidError, match="`columns`"):
        _ = predicted.acceleration
    force = {**responses, "at_rest": True}
    told = program("force", "examples/hammer-1.csv", "--system", path, *words(force), "--json")
    for system in (modes, str(path)):
        found = mechid.reconstruct(system, "examples/hammer-1.csv", **force)
        assert json.loads(found.to_json())["forces"] == json.loads(told)["forces"]


def test_every_scheme_of_the_program_is_offered() -> None:
    """The message that refuses an unknown name lists all known names."""
    with pytest.raises(mechid.MechidError, match="unknown variant") as caught:
        mechid.integrate(ONE, np.zeros(8), 100.0, scheme="guess")  # type: ignore[arg-type]
    known = set(re.findall("`([a-z0-9-]+)`", str(caught.value).split("expected one of")[1]))
    assert known == {*SCHEMES, "exact"} == set(typing.get_args(Scheme))


def test_several_decays_have_common_modes(tmp_path: Path) -> None:
    """Each of two releases moves one of the two modes."""
    t = np.arange(1500) / 250.0
    rng = np.random.default_rng(3)
    records = []
    for hz, ratio, shape in [(6.0, 0.01, [1.0, -0.5]), (30.0, 0.02, [0.4, 1.0])]:
        decay = np.exp(-ratio * 2 * np.pi * hz * t) * np.cos(2 * np.pi * hz * np.sqrt(1 - ratio**2) * t)
        moved = np.outer(decay, shape) + rng.normal(scale=0.02, size=(len(t), 2))
        records.append(tmp_path / f"{hz}.csv")
        np.savetxt(records[-1], np.column_stack([t, moved]), delimiter=",", header="time,a1,a2", comments="")
    found = mechid.modes(*records, acceleration="a1,a2", decay=True)
    assert len(found.modes) == 2
    for mode, hz in zip(found.modes, [6.0, 30.0]):
        low, high = mode.natural_frequency_hz.interval or (0, 0)
        assert high - low < 0.1 and abs(0.5 * (low + high) - hz) < 2 * (high - low)
    with pytest.raises(ValueError, match="exclude each other"):
        mechid.modes(*records, acceleration="a1,a2", decay=True, ambient=True)

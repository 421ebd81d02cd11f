"""Identification: exactly equal to the program, and compared with other methods in NumPy."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import mechid

FILE = "examples/machine.csv"
X, V, A = (("displacement", "displacement"), ("velocity", "velocity"), ("acceleration", "acceleration"))


def case(*kinds: tuple[str, str], **options: Any) -> Any:
    return pytest.param(dict(kinds), options, id=" ".join(f"{k}={v}" for k, v in options.items()))


CASES = [
    case(X, period=256),
    case(X, period=256, method="maximum-likelihood"),
    case(X, period=256, method="instrumental"),
    case(V, period=256),
    case(A, period=256, method="maximum-likelihood"),
    case(X, period=256, start=257),
    case(X, period=256, periods=1),
    case(X, period=128, start=3, periods=2),
    case(X, period=256, lines="odd"),
    case(X, period=256, lines="4:2:60", method="maximum-likelihood"),
    case(X, period=256, band_hz=(5.0, 20.5)),
    case(X, period=256, without_lines="10:20", noise="smooth"),
    case(X, period=256, without_hz=[10.0, 12.5], noise="neighbours:3"),
    case(X, period=256, mass=25.0),
    case(X, period=256, detrend="mean"),
    case(X, period=256, from_frf="h1"),
    case(X, from_frf="hv", segment=128),
    case(X, from_frf="h2", segment="128:66:hamming"),
    case(X, from_frf="h1", segment=128, method="least-squares", mass=25.0),
    case(X, V, A, domain="time"),
    case(X, V, domain="time"),
    case(X, V, domain="time", between_samples="euler"),
    case(X, V, domain="time", between_samples="held", extent="period", period=256),
    case(X, domain="time", derivatives="savitzky-golay:11:4"),
    case(X, domain="time", derivatives="spectral", period=256),
    case(X, V, domain="time", between_samples="euler", refine="4:spline"),
    case(X, V, A, domain="time", mass=25.0),
    case(X, period=256, nonlinear="k3: x1^3"),
    case(X, period=256, candidates="k3: x1^3, c2: |v1| v1"),
    case(X, period=256, nonlinear="c2: |v1| v1", weighting="response"),
    case(X, period=256, nonlinear="k3: x1^3", method="maximum-likelihood", search=["delay"]),
    case(X, period=256, periods=1, validate={"start": 257}),
    case(X, V, domain="time", validate={"start": 100, "samples": 200}),
]


def words(kinds: dict[str, str], options: dict[str, Any]) -> list[str]:
    """The options in the spelling of the program."""
    told = ["--force", "force"]
    for name, value in {**kinds, **options}.items():
        if isinstance(value, tuple):
            value = ":".join(str(part) for part in value)
        if isinstance(value, dict):
            value = ":".join(["", *(str(part) for part in value.values())])
        if isinstance(value, list):
            value = ",".join(str(part) for part in value)
        told += [f"--{name.replace('_', '-')}", str(value)]
    return told


@pytest.mark.parametrize(("kinds", "options"), CASES)
def test_the_program_says_the_same_to_the_last_bit(
    program: Callable[..., str], kinds: dict[str, str], options: dict[str, Any]
) -> None:
    told = program("identify", FILE, *words(kinds, options), "--json")
    found = mechid.identify(FILE, force="force", **kinds, **options)
    assert found.to_json() + "\n" == told
    assert found.to_dict() == json.loads(told)
    # The settings of the result repeat the analysis.
    record = {key: options[key] for key in ("start", "period", "periods", "detrend") if key in options}
    validated = {key: options[key] for key in options if key.startswith("validate")}
    again = mechid.identify(
        FILE, force="force", **kinds, **record, **validated, settings=found.settings
    )
    assert again.to_json() == found.to_json()


def test_as_text_it_is_the_report_of_the_program(program: Callable[..., str]) -> None:
    kinds: Any = {"displacement": "displacement"}
    # Without the period a remark names the option of the program, or the setting of Python.
    told = program("identify", FILE, *words(kinds, {"period": 256}))
    assert str(mechid.identify(FILE, force="force", **kinds, period=256)) == told


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_do_not_change_a_bit(threads: int) -> None:
    options: Any = {"displacement": "displacement", "velocity": "velocity", "domain": "time"}
    one = mechid.identify(FILE, force="force", **options)
    assert mechid.identify(FILE, force="force", threads=threads, **options).to_json() == one.to_json()


def test_arrays_of_any_layout_and_number_type_are_the_file(columns: dict[str, np.ndarray]) -> None:
    force, x = columns["force"], columns["displacement"]
    named = mechid.identify(FILE, force="force", displacement="displacement", period=256)
    wide = np.zeros((2, 2 * len(force)))
    wide[0, ::2], wide[1, ::2] = force, x
    strided, backwards = wide[0, ::2], x[::-1].copy()[::-1]
    shapes = [
        (force, x),
        (force[:, None], x[:, None]),
        (strided, backwards),
        (list(force), tuple(x)),
        (np.asfortranarray(force[:, None]), x.astype(np.longdouble)),
        (force.astype(">f8"), x),
    ]
    for f, response in shapes:
        found = mechid.identify(f, response, fs=128, period=256)
        assert {n: p.value for n, p in found.parameters.items()} == {
            n: p.value for n, p in named.parameters.items()
        }
        np.testing.assert_array_equal(found.covariance, named.covariance)
    by_keyword = mechid.identify(force=force, displacement=x, fs=128, period=256)
    assert by_keyword.stiffness == named.stiffness
    single = mechid.identify(force.astype(np.float32), x, fs=128, period=256)
    assert abs(single.parameters["k"].value / named.parameters["k"].value - 1) < 1e-6


def test_least_squares_on_spectra_is_that_of_numpy(columns: dict[str, np.ndarray]) -> None:
    """Reference: the equation of motion on every driven line, stacked and solved by NumPy alone."""
    found = mechid.identify(
        columns["force"], columns["displacement"], fs=128.0, period=256, lines="4:60",
        method="least-squares",
    )
    lines = np.arange(4, 61)
    force, x = (
        np.fft.rfft(columns[name].reshape(2, 256).mean(axis=0))[lines]
        for name in ("force", "displacement")
    )
    omega = 2 * np.pi * lines * 128 / 256
    design = np.stack([-(omega**2) * x, 1j * omega * x, x], axis=1)
    scale = np.linalg.norm(design, axis=0)
    stacked = np.concatenate([(design / scale).real, (design / scale).imag])
    solution = np.linalg.lstsq(stacked, np.concatenate([force.real, force.imag]), rcond=None)[0] / scale
    values = [found.parameters[name].value for name in ("m", "c", "k")]
    np.testing.assert_allclose(values, solution, rtol=1e-9)


def test_a_result_has_everything_as_arrays_and_numbers() -> None:
    found = mechid.identify(
        FILE, force="force", displacement="displacement", period=256, method="maximum-likelihood"
    )
    told = found.to_dict()
    assert found.mass.shape == (1, 1) and found.mass[0, 0] == found.parameters["m"].value
    assert found.estimated == ("m", "c", "k") and found.covariance.shape == (3, 3)
    errors = [found.parameters[name].std_error for name in found.estimated]
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), errors, rtol=1e-12)
    k = found.parameters["k"]
    assert list(k.interval(0.95)) == told["parameters"][2]["interval"]
    narrow, wide = k.interval(0.5), k.interval(0.999)
    assert wide[0] < narrow[0] < float(k) < narrow[1] < wide[1]
    assert (k.unit, k.matrix, k.row, k.column, k.known) == ("N/m", "stiffness", 1, 1, False)
    assert len(found.findings) == len(told["checks"]) > 3
    assert not found.warnings and all(finding.text for finding in found.findings)
    assert found.remarks == tuple(told["remarks"])
    mode = found.modes[0]
    # Reference: the eigenvalue of the characteristic polynomial.
    (m,), (c,), (stiffness,) = found.mass[0], found.damping[0], found.stiffness[0]
    root = np.roots([m, c, stiffness])
    eigenvalue = root[root.imag > 0][0]
    assert abs(mode.eigenvalue - eigenvalue) < 1e-9 * abs(eigenvalue)
    assert abs(mode.damping_ratio.value + eigenvalue.real / abs(eigenvalue)) < 1e-12
    assert mode.natural_frequency_hz.std_error is not None and mode.shape == np.array([1.0])
    a, b, c_, d = found.machine().state_space()
    receptance = c_ @ np.linalg.solve(60j * np.eye(2) - a, b) + d
    np.testing.assert_allclose(receptance, 1 / (stiffness - 3600 * m + 60j * c), rtol=1e-12)
    a, b, c_, d = found.machine().state_space("acceleration")
    accelerance = c_ @ np.linalg.solve(60j * np.eye(2) - a, b) + d
    np.testing.assert_allclose(accelerance, -3600 * receptance, rtol=1e-9)


def test_a_result_never_changes() -> None:
    found = mechid.identify(FILE, force="force", displacement="displacement", period=256)
    for change in (
        lambda: setattr(found, "mass", 1.0),
        lambda: setattr(found, "more", 1.0),
        lambda: setattr(found.parameters["k"], "value", 1.0),
        lambda: found.parameters.__setitem__("k", None),
    ):
        with pytest.raises((AttributeError, TypeError)):
            change()
    found.to_dict()["system"]["mass"][0][0] = 7.0
    found.mass[0, 0] = 7.0
    found.settings["method"] = None
    assert 24 < found.mass[0, 0] < 26 and "method" not in found.settings


def test_validation_tells_what_is_predicted(columns: dict[str, np.ndarray]) -> None:
    both = mechid.Measurement.open(FILE, force="force", displacement="displacement")
    first, second = (both.window(start=start, period=256, periods=1) for start in (1, 257))
    found = mechid.identify(first, method="least-squares")
    assert found.validation is None
    told = found.validate(second)
    assert told.fit_percent["displacement"] > 98
    assert mechid.identify(first, method="least-squares", validate=second).validation == told
    half = columns["displacement"] / 2
    wrong = mechid.Measurement.from_arrays(columns["force"], half, fs=128, period=256)
    assert found.validate(wrong).fit_percent["displacement"] < 1


def test_several_records_and_known_masses() -> None:
    both = mechid.Measurement.open(FILE, force="force", displacement="displacement")
    halves = [both.window(start=start, period=256, periods=1) for start in (1, 257)]
    found = mechid.identify(*halves, mass=25.0)
    assert len(found.to_dict()["records"]) == 2
    assert found.parameters["m"].known and found.parameters["m"].std_error is None
    assert found.estimated == ("c", "k")


def test_the_form_of_the_matrices_takes_the_place_of_forces() -> None:
    mass, stiffness = [[2.0, 0.0], [0.0, 3.0]], [[3000.0, -1000.0], [-1000.0, 2000.0]]
    damping = [[0.4 * m + 0.002 * k for m, k in zip(*rows)] for rows in zip(mass, stiffness)]
    simulated = mechid.simulate({
        "system": {"mass": mass, "damping": damping, "stiffness": stiffness},
        "sampling": {"samples": 256, "rate_hz": 64},
        "excitation": [{"dof": 1, "lines": "2:100", "amplitude": 1, "phases": "random", "seed": 1}],
        "periods": 4,
        "scheme": {"name": "exact"},
        "response": "periodic",
        "noise": {"displacement": {"snr_db": 60}, "seed": 2},
    })
    record = mechid.Measurement.from_arrays(
        simulated.force, simulated.displacement, fs=64, period=256
    )
    found = mechid.identify(record, structure=["chain", "proportional-damping"])
    assert found.parameters["m22"].value == pytest.approx(3.0, rel=1e-2)
    assert found.parameters["k12"].value == found.parameters["k21"].value
    factors = found.to_dict()["proportional_damping"]
    assert factors["beta"]["value"] == pytest.approx(0.002, rel=1e-2)
    assert mechid.identify(record, structure="chain").parameters["c11"].known is False
    for wrong in (
        lambda: mechid.identify(record, structure="chains"),
        lambda: mechid.identify(record, structure="symmetric", domain="time"),
        lambda: mechid.identify(record, structure="k13=0"),
    ):
        with pytest.raises((mechid.MechidError, ValueError)):
            wrong()

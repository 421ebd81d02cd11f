"""Results as xarray datasets: dimensions with coordinates, variables with units.

xarray is imported with this module, and this module only if a dataset is requested.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from ._errors import MechidError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ._results import FrequencyResponses, Identified, Reconstructed, Simulation, Sweep

_UNITS = {"force": "N", "displacement": "m", "velocity": "m/s", "acceleration": "m/s²"}
_MATRICES = {"mass": "kg", "damping": "N·s/m", "stiffness": "N/m"}


def frequency_responses(found: FrequencyResponses) -> xarray.Dataset:
    """Return responses, standard errors and coherence over frequency."""
    motions = sorted({motion for motion, _ in found.pairs})
    forces = sorted({force for _, force in found.pairs})
    responses = np.array([[found.response(m, f) for f in forces] for m in motions])
    errors = np.array([[found.std_error(m, f) for f in forces] for m in motions])
    coherence = np.array([found.coherence(motion) for motion in motions])
    pair = ("motion", "force", "frequency")
    data = {
        "response": (pair, responses, {"units": found.unit}),
        "std_error": (pair, errors, {"units": found.unit}),
        "coherence": (("motion", "frequency"), coherence, {"units": "1"}),
    }
    coordinates = {"motion": motions, "force": forces, "frequency": _frequency(found.frequency_hz)}
    told = found.to_dict()
    about = {"record": told["file"], "estimator": told["estimator"]}
    return xarray.Dataset(data, coordinates, about)


def identified(found: Identified) -> xarray.Dataset:
    """Return responses over time, receptances over frequency, and the parameters.

    Responses are omitted if the identified system is unstable, receptances if the records show
    none.
    """
    told = found.to_dict()
    data: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    try:
        compared = found.compared
    except MechidError:
        compared = {}
    for kind, (measured, predicted) in compared.items():
        coordinates["time"] = _time(len(measured), told["window"]["sample_rate_hz"])
        named = {"": measured, "_predicted": predicted, "_residual": measured - predicted}
        for ending, values in named.items():
            data[f"{kind}{ending}"] = _channels(values, _UNITS[kind])
    try:
        table = found.frf
    except MechidError:
        pass
    else:
        coordinates["frequency"] = _frequency(table.frequency_hz)
        for name, responses in (("frf", table.measured), ("frf_model", table.model)):
            data[name] = (("frequency", "motion", "driven"), responses, {"units": "m/N"})
    dofs = np.arange(1, len(found.modes[0].shape) + 1)
    if found.unscaled is None:
        for name, unit in _MATRICES.items():
            data[name] = (("row", "column"), getattr(found, name), {"units": unit})
    parameters = [found.parameters[name] for name in found.estimated]
    data["value"] = ("parameter", np.array([p.value for p in parameters]))
    errors = [np.nan if p.std_error is None else p.std_error for p in parameters]
    data["std_error"] = ("parameter", np.array(errors))
    data["covariance"] = (("parameter", "other_parameter"), found.covariance)
    coordinates["parameter"] = list(found.estimated)
    coordinates["other_parameter"] = list(found.estimated)
    coordinates["unit"] = ("parameter", [p.unit for p in parameters])
    for dimension in ("dof", "motion", "driven", "row", "column"):
        if any(dimension in row[0] for row in data.values()):
            coordinates[dimension] = dofs
    return xarray.Dataset(data, coordinates, {"record": told["file"]})


def reconstructed(found: Reconstructed) -> xarray.Dataset:
    """Return force and standard error over time, and the spectrum of the force."""
    frequency, spectrum = found.spectrum
    told = found.to_dict()
    force, error = found.force, found.std_error
    data = {"force": _channels(force, "N")}
    if error is not None:
        data["std_error"] = _channels(error, "N")
    data["spectrum"] = (("frequency", "dof"), spectrum, {"units": "N"})
    coordinates = {
        "time": _time(len(force), told["sample_rate_hz"]),
        "frequency": _frequency(frequency),
        "dof": np.arange(1, force.shape[1] + 1),
    }
    return xarray.Dataset(data, coordinates, {"record": told["file"], "method": told["method"]})


def simulation(found: Simulation) -> xarray.Dataset:
    """Return force and responses over time, measured and without noise."""
    data: dict[str, Any] = {}
    for kind, unit in _UNITS.items():
        data[kind] = _channels(getattr(found, kind), unit)
        data[f"{kind}_truth"] = _channels(found.truth[kind], unit)
    samples, dofs = found.force.shape
    coordinates = {"time": _time(samples, found.fs), "dof": np.arange(1, dofs + 1)}
    return xarray.Dataset(data, coordinates, {"scheme": found.scheme})


def sweep(found: Sweep) -> xarray.Dataset:
    """Return the error and the estimates over the settings; NaN where there is no estimate."""
    points, kind = found.points, found.settings["kind"]
    units = {p["name"]: p["unit"] for point in points for p in point["parameters"]}
    data: dict[str, Any] = {"error": ("setting", found.error, {"units": "1"})}
    for name, unit in units.items():
        for variable, field in ((name, "value"), (f"{name}_std_error", "standard_error")):
            values = [_of(point["parameters"], name, field) for point in points]
            data[variable] = ("setting", np.array(values, dtype=np.float64), {"units": unit})
    coordinates = {"setting": ("setting", found.values, {"kind": kind})}
    return xarray.Dataset(data, coordinates, {"record": found.to_dict()["file"], "best": found.best})


def _of(rows: list[Mapping[str, Any]], name: str, field: str) -> float:
    found = next((row[field] for row in rows if row["name"] == name), None)
    return np.nan if found is None else float(found)


def _channels(values: NDArray[np.float64], unit: str) -> tuple[tuple[str, str], Any, dict[str, str]]:
    return ("time", "dof"), values, {"units": unit}


def _time(samples: int, rate_hz: float) -> tuple[str, NDArray[np.float64], dict[str, str]]:
    return "time", np.arange(samples) / rate_hz, {"units": "s"}


def _frequency(values_hz: NDArray[np.float64]) -> tuple[str, NDArray[np.float64], dict[str, str]]:
    return "frequency", values_hz, {"units": "Hz"}

"""Parts of results: all of them exist, are read-only, and can be copied and pickled."""

from __future__ import annotations

import copy
import inspect
import multiprocessing
import pickle
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest

import mechid

from .test_elements import MACHINE as ELEMENTS

FILE, EXPERIMENT = "examples/machine.csv", "examples/machine.json"
COLUMNS: Any = {"force": "force", "displacement": "displacement"}
RIG: Any = {
    "force": ["fx", "fy"], "acceleration": ["ax", "ay"], "displacement": ["dx", "dy"], "period": 256,
    "stator_mass": 20.0, "rotation_hz": 50.0,
}  # fmt: skip
HITS: Any = {"force": "force", "acceleration": ["a1", "a2"], "hits": True, "band_hz": (2, 100)}


def identified() -> mechid.Identified:
    return mechid.identify(FILE, **COLUMNS, period=256, validate=mechid.Measurement.open(FILE, **COLUMNS, period=256))


def of_table() -> mechid.IdentifiedResponses:
    omega = np.linspace(10.0, 60.0, 100)
    response = 1 / (5000 - omega**2 * 10 + 1j * omega * 180)
    return mechid.identify_responses(mechid.ResponseTable(omega / (2 * np.pi), response, quantity="displacement"))


MADE: dict[str, Callable[[], Any]] = {
    "identified": identified,
    "tables": of_table,
    "nonlinear": lambda: mechid.identify(FILE, **COLUMNS, period=256, nonlinear="k3: x1^3"),
    "machine": lambda: mechid.Machine(25.0, 188.5, 142_122.0),
    "frequency responses": lambda: mechid.frf(FILE, **COLUMNS, period=256),
    "inspected": lambda: mechid.inspect(FILE, curves=True),
    "decay": lambda: mechid.decay("examples/decay.csv", acceleration=["a1", "a2", "a3"]),
    "modes": lambda: mechid.modes("examples/hammer-1.csv", **HITS),
    "bearing": lambda: mechid.bearing("examples/bearing-rig.csv", baseline="examples/bearing-dry.csv", **RIG),
    "elements": lambda: mechid.identify_elements(FILE, machine=ELEMENTS, period=256),
    "force": lambda: mechid.reconstruct(of_table(), FILE, displacement="displacement", period=256),
    "sweep": lambda: mechid.sweep(EXPERIMENT, npi=[2, 4]),
    "simulation": lambda: mechid.simulate(EXPERIMENT),
    "multisine": lambda: mechid.multisine(64, 64.0, lines="3:23"),
    "record": lambda: mechid.Measurement.open(FILE, **COLUMNS, period=256),
}


def parts(result: Any) -> Iterator[tuple[str, Any]]:
    """Public attributes of a result that are not methods."""
    for name in dir(type(result)):
        thing = inspect.getattr_static(result, name)
        if not name.startswith("_") and not callable(thing) and not isinstance(thing, (classmethod, staticmethod)):
            yield name, getattr(result, name)


@pytest.mark.parametrize("kind", MADE)
def test_every_part_of_a_result_is_copied_and_pickled(kind: str) -> None:
    result = MADE[kind]()
    names = []
    for name, part in parts(result):
        names.append(name)
        for again in (pickle.loads(pickle.dumps(part)), copy.deepcopy(part), copy.copy(part)):
            assert type(again) is type(part), name
            assert repr(again) == repr(part) or name == "figures", name
    assert names


@pytest.mark.parametrize("made", [identified, of_table])
def test_a_pickled_parameter_keeps_its_numbers_and_its_usual_interval(made: Callable[[], Any]) -> None:
    found = made()
    k = found.parameters["k"]
    stored = pickle.loads(pickle.dumps(found))
    for again in (
        pickle.loads(pickle.dumps(k)),
        pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(k)))),
        pickle.loads(pickle.dumps(found.parameters))["k"],
        stored.parameters["k"],
        pickle.loads(pickle.dumps(stored)).parameters["k"],
    ):
        assert again == k and again.interval() == k.interval()
        with pytest.raises(mechid.MechidError, match="was pickled"):
            again.interval(0.9)
    assert copy.deepcopy(k).interval(0.9) == k.interval(0.9)
    assert len(pickle.dumps(found.parameters)) < 2000


def test_a_known_parameter_is_pickled_too() -> None:
    known = mechid.identify(FILE, **COLUMNS, period=256, mass=25.0).parameters["m"]
    again = pickle.loads(pickle.dumps(known))
    assert again == known and again.known
    with pytest.raises(mechid.MechidError):
        again.interval()


def sent() -> tuple[Any, ...]:
    found = identified()
    return found.parameters, found.findings[0], found.fit, found.validation, found.frf


def test_parts_come_back_from_other_processes() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        there = pool.apply_async(sent).get(timeout=60)
    assert repr(there) == repr(sent())
    np.testing.assert_array_equal(there[4].model, sent()[4].model)
    assert there[0]["m"].interval() == identified().parameters["m"].interval()


def test_receptances_are_short_when_printed() -> None:
    table = identified().frf
    assert repr(table) == f"<Receptances: {len(table.frequency_hz)} frequencies, responses: 1, forces: 1>"


def test_mappings_of_results_are_read_only() -> None:
    found = identified()
    fit: Any = found.fit
    with pytest.raises(TypeError, match="item assignment"):
        fit["nrmse"] = 0.0
    assert isinstance(fit, Mapping) and fit == dict(fit) and dict(fit) == fit
    assert fit | {"nrmse": 0.0} == {**fit, "nrmse": 0.0} and {"nrmse": 0.0} | fit == dict(fit)
    assert fit.copy() is not fit and list(fit) == list(fit.keys()) and "nrmse" in fit
    assert repr(fit) == repr(dict(fit))


def test_a_linear_machine_has_no_nonlinear_terms() -> None:
    assert mechid.identify(FILE, **COLUMNS, period=256).nonlinear is None
    cubic = mechid.identify(FILE, **COLUMNS, period=256, nonlinear="k3: x1^3")
    assert cubic.nonlinear is not None and "k3" in str(dict(cubic.nonlinear))


def test_modes_and_elements_have_remarks_too() -> None:
    modes = mechid.modes("examples/hammer-1.csv", **HITS)
    assert modes.remarks == modes.notes
    described = {**ELEMENTS, "elements": [
        ELEMENTS["elements"][0],
        {"name": "foot", "at": "displacement", "k": {"start": 3e5, "min": 2e5}, "c": {"start": 50}},
    ]}  # fmt: skip
    found = mechid.identify_elements(FILE, machine=described, period=256)
    assert len(found.remarks) == len(found.notes) > 0
    assert all(f"note: {remark}" in str(found) for remark in found.remarks)
    assert mechid.identify_elements(FILE, machine=ELEMENTS, period=256).remarks == ()

"""Machines of named elements: descriptions as dicts with arrays, results, failures."""

from __future__ import annotations

import copy
import json
from typing import Any

import numpy as np
import pytest

import mechid

from .conftest import ROOT

# The machine of the examples: 25 kg at 12 Hz with a damping ratio of 0.05.
OMEGA = 2 * np.pi * 12
TRUTH = {"m": 25.0, "foot.k": 25 * OMEGA**2, "foot.c": 2 * 0.05 * OMEGA * 25}
RECORD = ROOT / "examples/machine.csv"
MACHINE: dict[str, Any] = {
    "dofs": ["displacement"],
    "elements": [
        {"name": "m", "at": "displacement", "m": {"start": 10.0, "min": 0}},
        {"name": "foot", "at": "displacement", "k": {"start": 1e5, "min": 0}, "c": {"start": 50}},
    ],
    "sensors": [{"at": "displacement", "quantity": "displacement"}],
    "inputs": [{"kind": "force", "name": "force", "at": "displacement"}],
}


def is_true(found: mechid.IdentifiedElements) -> None:
    for name, truth in TRUTH.items():
        p = found.parameters[name]
        assert p.std_error is not None
        assert abs(p.value - truth) < 4 * p.std_error, (name, p, truth)


def test_a_dict_is_a_machine() -> None:
    found = mechid.identify_elements(RECORD, machine=MACHINE, period=256)
    is_true(found)
    names, covariance = found.covariance
    assert names == tuple(TRUTH)
    assert np.allclose(np.sqrt(covariance.diagonal()), [p.std_error for p in found.parameters.values()])
    assert not found.at_bound and not found.combinations and len(found.minima) >= 1
    machine = found.machine()
    assert machine.mass[0, 0] == found.parameters["m"].value
    assert "foot.k" in str(found) and "<svg" in found.to_svg()
    assert {finding.subject for finding in found.findings} >= {"misfit", "search"}


def test_a_file_and_measurements_say_the_same(tmp_path: Any) -> None:
    (tmp_path / "machine.json").write_text(json.dumps(MACHINE))
    measured = mechid.Measurement.open(RECORD, force="force", displacement="displacement", period=256)
    found = mechid.identify_elements(measured, machine=tmp_path / "machine.json")
    is_true(found)


def test_known_matrices_are_arrays() -> None:
    machine = copy.deepcopy(MACHINE)
    machine["elements"][0] = {"name": "body", "dofs": ["displacement"], "mass": np.array([[25.0]])}
    found = mechid.identify_elements(RECORD, machine=machine, period=256, starts=1)
    assert sorted(found.parameters) == ["foot.c", "foot.k"]
    sparse = pytest.importorskip("scipy.sparse")
    machine["elements"][0]["mass"] = sparse.csr_array(np.array([[25.0]]))
    again = mechid.identify_elements(RECORD, machine=machine, period=256, starts=1)
    assert again.parameters == found.parameters


def test_bearings_of_a_rotor_from_runs_over_the_speed() -> None:
    folder = ROOT / "examples/rotor"
    found = mechid.identify_elements(folder / "runs.csv", machine=folder / "rotor.json", speed_table=True)
    kxx = found.parameters["A.kxx"]
    assert kxx.std_error is not None and abs(kxx.value - 1.2e6) < 4 * kxx.std_error
    assert found.candidates[0]["newly_determined"] == 0


def test_failures_name_what_is_wrong() -> None:
    machine = copy.deepcopy(MACHINE)
    machine["elements"][1]["at"] = "nowhere"
    with pytest.raises(mechid.MechidError, match='element "foot" is at "nowhere"') as failure:
        mechid.identify_elements(RECORD, machine=machine, period=256)
    assert failure.value.code == "machine.unknown-dof"

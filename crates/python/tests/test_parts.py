"""Parts of results."""

from __future__ import annotations

from typing import Any

import mechid

FILE, EXPERIMENT = "examples/machine.csv", "examples/machine.json"
COLUMNS: Any = {"force": "force", "displacement": "displacement"}
ELEMENTS: Any = {
    "dofs": ["displacement"],
    "elements": [
        {"name": "m", "at": "displacement", "m": {"start": 10.0, "min": 0}},
        {"name": "foot", "at": "displacement", "k": {"start": 1e5, "min": 0}, "c": {"start": 50}},
    ],
    "sensors": [{"at": "displacement", "quantity": "displacement"}],
    "inputs": [{"kind": "force", "name": "force", "at": "displacement"}],
}
HITS: Any = {"force": "force", "acceleration": ["a1", "a2"], "hits": True, "band_hz": (2, 100)}


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

"""Identify a machine from a measured force and response.

>>> import mechid
>>> found = mechid.identify("examples/machine.csv", force="force",
...                         displacement="displacement", period=256)
>>> mass = found.parameters["m"].value  # kg

Everything is in SI units, and in Hz where a name ends in ``_hz``. A record is a file, or arrays of
shape ``(samples,)`` or ``(samples, degrees of freedom)``. A failure raises `MechidError`, a
`ValueError` with a message that states the cause and the remedy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._analyses import bearing as bearing
    from ._analyses import bearing_campaign as bearing_campaign
    from ._analyses import compare_modes as compare_modes
    from ._analyses import decay as decay
    from ._analyses import frf as frf
    from ._analyses import identify as identify
    from ._analyses import identify_elements as identify_elements
    from ._analyses import identify_responses as identify_responses
    from ._analyses import inspect as inspect
    from ._analyses import integrate as integrate
    from ._analyses import modes as modes
    from ._analyses import multisine as multisine
    from ._analyses import predict as predict
    from ._analyses import reconstruct as reconstruct
    from ._analyses import selected_modes as selected_modes
    from ._analyses import simulate as simulate
    from ._analyses import sweep as sweep
    from ._errors import MechidError as MechidError
    from ._mechid import __version__ as __version__
    from ._records import Measurement as Measurement
    from ._records import ResponseTable as ResponseTable
    from ._results import BearingTable as BearingTable
    from ._results import Decayed as Decayed
    from ._results import Finding as Finding
    from ._results import FrequencyResponses as FrequencyResponses
    from ._results import Identified as Identified
    from ._results import IdentifiedBearing as IdentifiedBearing
    from ._results import IdentifiedElements as IdentifiedElements
    from ._results import IdentifiedResponses as IdentifiedResponses
    from ._results import Inspected as Inspected
    from ._results import Machine as Machine
    from ._results import Mode as Mode
    from ._results import ModeComparison as ModeComparison
    from ._results import Modes as Modes
    from ._results import Multisine as Multisine
    from ._results import Parameter as Parameter
    from ._results import Predicted as Predicted
    from ._results import Receptances as Receptances
    from ._results import Reconstructed as Reconstructed
    from ._results import SelectedModes as SelectedModes
    from ._results import Simulation as Simulation
    from ._results import Sweep as Sweep
    from ._results import Uncertain as Uncertain
    from ._results import Validation as Validation

# Module of each name; it is imported when the name is used, so that the program starts without NumPy.
_HOMES = {
    "bearing": "_analyses",
    "bearing_campaign": "_analyses",
    "compare_modes": "_analyses",
    "decay": "_analyses",
    "frf": "_analyses",
    "identify": "_analyses",
    "identify_elements": "_analyses",
    "identify_responses": "_analyses",
    "inspect": "_analyses",
    "integrate": "_analyses",
    "modes": "_analyses",
    "multisine": "_analyses",
    "predict": "_analyses",
    "reconstruct": "_analyses",
    "selected_modes": "_analyses",
    "simulate": "_analyses",
    "sweep": "_analyses",
    "MechidError": "_errors",
    "__version__": "_mechid",
    "Measurement": "_records",
    "ResponseTable": "_records",
    "BearingTable": "_results",
    "Decayed": "_results",
    "Finding": "_results",
    "FrequencyResponses": "_results",
    "Identified": "_results",
    "IdentifiedBearing": "_results",
    "IdentifiedElements": "_results",
    "IdentifiedResponses": "_results",
    "Inspected": "_results",
    "Machine": "_results",
    "Mode": "_results",
    "ModeComparison": "_results",
    "Modes": "_results",
    "Multisine": "_results",
    "Parameter": "_results",
    "Predicted": "_results",
    "Receptances": "_results",
    "Reconstructed": "_results",
    "SelectedModes": "_results",
    "Simulation": "_results",
    "Sweep": "_results",
    "Uncertain": "_results",
    "Validation": "_results",
}

__all__ = [
    "BearingTable",
    "Decayed",
    "Finding",
    "FrequencyResponses",
    "Identified",
    "IdentifiedBearing",
    "IdentifiedElements",
    "IdentifiedResponses",
    "Inspected",
    "Machine",
    "Measurement",
    "MechidError",
    "Mode",
    "ModeComparison",
    "Modes",
    "Multisine",
    "Parameter",
    "Predicted",
    "Receptances",
    "Reconstructed",
    "ResponseTable",
    "SelectedModes",
    "Simulation",
    "Sweep",
    "Uncertain",
    "Validation",
    "__version__",
    "bearing",
    "bearing_campaign",
    "compare_modes",
    "decay",
    "frf",
    "identify",
    "identify_elements",
    "identify_responses",
    "inspect",
    "integrate",
    "modes",
    "multisine",
    "predict",
    "reconstruct",
    "selected_modes",
    "simulate",
    "sweep",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})

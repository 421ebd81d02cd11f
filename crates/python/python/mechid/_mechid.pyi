"""The compiled half of the package: the library and the program `mechid`, settings and results as JSON."""

from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import TypeAlias, final

import numpy as np
from numpy.typing import NDArray

# A record of a fleet: its file and, of a file of many records, its name and its rows (from, to).
_Place: TypeAlias = tuple[Path, tuple[str, int, int] | None]

__all__ = [
    "Answer",
    "Identified",
    "IdentifiedResponses",
    "Machine",
    "Measurement",
    "Predicted",
    "Reconstructed",
    "ResponseTable",
    "__version__",
    "bearing",
    "bearing_of_responses",
    "fleet_begin",
    "fleet_part",
    "fleet_rows",
    "fleet_simulate",
    "fleet_summary",
    "fleet_trends",
    "frf",
    "identify",
    "identify_responses",
    "inspect",
    "integrate",
    "multisine",
    "predict",
    "predict_record",
    "program",
    "reconstruct",
    "simulate",
    "sweep",
]

__version__: str

@final
class Measurement:
    @staticmethod
    def open(plan: str) -> Measurement: ...
    @staticmethod
    def from_columns(
        name: str,
        rate_hz: float,
        columns: Sequence[tuple[str, NDArray[np.float64]]],
        channels: str,
        window: str,
    ) -> Measurement: ...
    def window(self, window: str) -> Measurement: ...
    @property
    def name(self) -> str: ...
    @property
    def samples(self) -> int: ...
    @property
    def fs(self) -> float: ...
    @property
    def window_settings(self) -> str: ...
    @property
    def channels(self) -> str: ...
    @property
    def plan(self) -> str | None: ...
    def force(self) -> NDArray[np.float64]: ...
    def responses(self) -> list[tuple[str, NDArray[np.float64]]]: ...

@final
class Machine:
    @staticmethod
    def known(
        mass: NDArray[np.float64], damping: NDArray[np.float64], stiffness: NDArray[np.float64]
    ) -> Machine: ...
    @staticmethod
    def read(path: str | PathLike[str]) -> Machine: ...
    @property
    def name(self) -> str: ...
    @property
    def is_exact(self) -> bool: ...
    @property
    def mass(self) -> NDArray[np.float64]: ...
    @property
    def damping(self) -> NDArray[np.float64]: ...
    @property
    def stiffness(self) -> NDArray[np.float64]: ...
    def state_matrices(self) -> list[NDArray[np.float64]]: ...
    def receptances(self, omega: Sequence[float]) -> NDArray[np.complex128]: ...
    def svg(self) -> str: ...
    def modal(self) -> tuple[str, str]: ...

@final
class Identified:
    def to_json(self) -> str: ...
    def text(self) -> str: ...
    def svg(self) -> str: ...
    def page(self, title: str | None, force: bool) -> str: ...
    def compared(self) -> list[tuple[str, NDArray[np.float64], NDArray[np.float64]]]: ...
    def spectra(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.complex128]] | None: ...
    def receptances(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.complex128]]: ...
    def interval(self, name: str, level: float) -> list[float]: ...
    def machine(self) -> Machine: ...
    def validate(self, other: Measurement, samples: str) -> str: ...

def identify(
    records: Sequence[Measurement],
    settings: str,
    validate: tuple[Measurement, str] | None,
    threads: int | None,
) -> Identified: ...

@final
class ResponseTable:
    @staticmethod
    def read(path: str | PathLike[str]) -> ResponseTable: ...
    @staticmethod
    def from_arrays(
        layout: str,
        frequency_hz: NDArray[np.float64],
        response: NDArray[np.complex128],
        std_error: NDArray[np.float64] | None,
        coherence: NDArray[np.float64] | None,
    ) -> ResponseTable: ...
    @property
    def name(self) -> str: ...
    @property
    def frequencies(self) -> int: ...

@final
class IdentifiedResponses:
    def to_json(self) -> str: ...
    def text(self) -> str: ...
    def svg(self) -> str: ...
    def interval(self, name: str, level: float) -> list[float]: ...
    def machine(self) -> Machine: ...

def identify_responses(
    tables: Sequence[ResponseTable], settings: str, threads: int | None
) -> IdentifiedResponses: ...
@final
class Answer:
    def to_json(self) -> str: ...
    def text(self) -> str: ...
    def svg(self) -> str: ...

@final
class Reconstructed:
    def to_json(self) -> str: ...
    def text(self) -> str: ...
    def svg(self) -> str: ...
    @property
    def force(self) -> NDArray[np.float64]: ...
    @property
    def std_error(self) -> NDArray[np.float64] | None: ...
    def spectrum(self) -> tuple[NDArray[np.float64], NDArray[np.complex128]]: ...

_Named: TypeAlias = tuple[str, NDArray[np.float64]]
_Simulated: TypeAlias = tuple[
    str,
    float,
    Machine | None,
    tuple[NDArray[np.float64], list[_Named]],
    tuple[NDArray[np.float64], list[_Named]],
]
_Sampled: TypeAlias = tuple[
    NDArray[np.float64],
    list[int],
    NDArray[np.float64],
    NDArray[np.float64],
    tuple[float, float, float],
]

@final
class Predicted:
    def to_json(self) -> str: ...
    def text(self) -> str: ...
    def responses(self) -> list[tuple[str, NDArray[np.float64]]]: ...

def predict_record(record: Measurement, machine: Machine, settings: str) -> Predicted: ...
def frf(record: Measurement, settings: str, threads: int | None) -> Answer: ...
def bearing(
    tests: Sequence[Measurement], baseline: Sequence[Measurement], settings: str, threads: int | None
) -> Answer: ...
def bearing_of_responses(
    tests: Sequence[ResponseTable], baseline: Sequence[ResponseTable], settings: str, threads: int | None
) -> Answer: ...
def inspect(plan: str, settings: str) -> Answer: ...
def sweep(
    record: Measurement | None,
    experiment: tuple[str, str],
    settings: str,
    reference: Machine | None,
    progress: Callable[[int], object] | None,
    threads: int | None,
) -> Answer: ...
def reconstruct(
    record: Measurement, machine: Machine, settings: str, threads: int | None
) -> Reconstructed: ...
def simulate(name: str, description: str) -> _Simulated: ...
def integrate(description: str, force: NDArray[np.float64], fs: float) -> list[_Named]: ...
def predict(
    machine: Machine,
    force: NDArray[np.float64],
    fs: float,
    between_samples: str,
    extent: str,
    start: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
) -> list[_Named]: ...
def multisine(
    samples: int,
    fs: float,
    lines: str,
    phases: str,
    search: tuple[int, int],
    level: tuple[str, float],
) -> _Sampled: ...
def fleet_begin(
    records: Sequence[str | PathLike[str]], analysis: str, folder: str, part_records: int
) -> list[list[_Place]]: ...
def fleet_part(records: Sequence[_Place], analysis: str, folder: str) -> str: ...
def fleet_rows(
    records: Sequence[tuple[str, Sequence[tuple[str, NDArray[np.float64]]]]], analysis: str
) -> bytes: ...
def fleet_simulate(
    name: str,
    description: str,
    runs: int | None,
    fields: Sequence[tuple[str, NDArray[np.float64]]],
    out: str,
) -> tuple[str, str]: ...
def fleet_trends(folder: str, over_number: bool, title: str) -> tuple[str, str, str]: ...
def fleet_summary(parts: Sequence[str], folder: str, elapsed_s: float) -> tuple[str, str]: ...
def program(arguments: Sequence[str]) -> int: ...

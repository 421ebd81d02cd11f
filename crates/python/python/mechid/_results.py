"""Results, which never change."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NoReturn, Unpack, final

import numpy as np

from . import _mechid
from ._records import Measurement, RecordOptions, measurements

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@final
@dataclass(frozen=True, slots=True)
class Uncertain:
    """A number with its standard error and 95 % confidence interval, in its unit.

    Both are None for a number that is known.
    """

    value: float
    std_error: float | None
    interval: tuple[float, float] | None

    def __float__(self) -> float:
        return self.value


@final
@dataclass(frozen=True, slots=True)
class Parameter:
    """An entry of M, C or K with its uncertainty.

    Attributes
    ----------
    name : str
        ``"m"``, ``"c"``, ``"k"``, or ``"m11"``, ``"c12"`` … with several degrees of freedom.
    value : float
        The estimate, in ``unit``.
    std_error : float or None
        Its standard error; None for a value that was given.
    unit : str
        SI unit.
    matrix : str
        ``"mass"``, ``"damping"`` or ``"stiffness"``.
    row, column : int
        Place in the matrix, counted from 1.
    known : bool
        Whether the value was given, not estimated.
    """

    name: str
    value: float
    std_error: float | None
    unit: str
    matrix: str
    row: int
    column: int
    known: bool
    _found: _mechid.Identified

    def __float__(self) -> float:
        return self.value

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Return the confidence interval at a level between 0 and 1, by Student's t.

        Raises
        ------
        MechidError
            If the level is not between 0 and 1, or the value is known.
        """
        low, high = self._found.interval(self.name, level)
        return low, high


@final
@dataclass(frozen=True, slots=True)
class Mode:
    """A mode of a machine.

    Attributes
    ----------
    oscillates : bool
        Whether it is underdamped.
    natural_frequency_hz, damped_frequency_hz : Uncertain
        In Hz.
    damping_ratio : Uncertain
        Dimensionless.
    eigenvalue : complex
        In rad/s.
    shape : array of complex
        One entry per degree of freedom, the largest is 1.
    shape_std_error : array of complex, or None
        Standard errors of the real and imaginary parts of ``shape``.
    """

    oscillates: bool
    natural_frequency_hz: Uncertain
    damped_frequency_hz: Uncertain
    damping_ratio: Uncertain
    eigenvalue: complex
    shape: NDArray[np.complex128]
    shape_std_error: NDArray[np.complex128] | None


@final
@dataclass(frozen=True, slots=True)
class Finding:
    """One finding of the checks before and after a fit.

    Attributes
    ----------
    when : {"before", "after"}
        Whether it looks at the data or at what the fit leaves.
    record : str or None
        The record, where there are several.
    subject : str
        What was looked at.
    verdict : {"good", "doubtful", "bad"}
        What came of it.
    value : float or None
        The number that decides; None where it is infinite.
    text : str
        The finding, in a sentence.
    numbers : mapping
        All numbers of the finding, by name.
    """

    when: Literal["before", "after"]
    record: str | None
    subject: str
    verdict: str
    value: float | None
    text: str
    numbers: Mapping[str, Any]


@final
@dataclass(frozen=True, slots=True)
class Validation:
    """How well an identified machine predicts a record that was not fitted.

    Attributes
    ----------
    fit_percent : mapping of str to float
        Predicted part of each channel, in per cent; 100 is perfect.
    values : mapping
        Everything, as in the JSON of the program.
    """

    fit_percent: Mapping[str, float]
    values: Mapping[str, Any]

    @classmethod
    def _of(cls, told: dict[str, Any]) -> Validation:
        channels = told["channels"]
        several = any(channel["degree_of_freedom"] > 1 for channel in channels)
        fit = {
            f"{channel['quantity']} {channel['degree_of_freedom']}" if several else channel["quantity"]: float(
                channel["fit_percent"]
            )
            for channel in channels
        }
        return cls(MappingProxyType(fit), MappingProxyType(told))


class Result:
    """What results have in common; they never change."""

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"a result never changes: `{name}` cannot be set")

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"a result never changes: `{name}` cannot be deleted")

    @cached_property
    def _told(self) -> dict[str, Any]:
        told: dict[str, Any] = json.loads(self.to_json())
        return told

    def to_json(self) -> str:
        """Return the result as the program prints it with ``--json``."""
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """Return the result as dictionaries, lists and numbers, as `to_json` has them."""
        told: dict[str, Any] = json.loads(self.to_json())
        return told

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks to read before using the numbers."""
        return tuple(self._told["remarks"])

    @property
    def settings(self) -> dict[str, Any]:
        """Settings that repeat the analysis."""
        settings: dict[str, Any] = self.to_dict()["analysis"]
        return settings


@final
class Identified(Result):
    """An identified machine, with what speaks for and against it.

    ``print`` shows it as the program does; `to_json` is the JSON of the program.
    """

    def __init__(self, inner: _mechid.Identified) -> None:
        self.__dict__["_inner"] = inner

    _inner: _mechid.Identified

    @cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """Entries of M, C and K by name, with standard errors."""
        rows = self._told["parameters"]
        return MappingProxyType({row["name"]: self._parameter(row) for row in rows})

    def _parameter(self, row: dict[str, Any]) -> Parameter:
        return Parameter(
            name=row["name"],
            value=_number(row["value"]),
            std_error=row["standard_error"],
            unit=row["unit"],
            matrix=row["matrix"],
            row=row["row"],
            column=row["column"],
            known=row["known"],
            _found=self._inner,
        )

    @property
    def mass(self) -> NDArray[np.float64]:
        """M, in kg, shape (degrees of freedom, degrees of freedom)."""
        return _array(self._told["system"]["mass"])

    @property
    def damping(self) -> NDArray[np.float64]:
        """C, in N·s/m, likewise."""
        return _array(self._told["system"]["damping"])

    @property
    def stiffness(self) -> NDArray[np.float64]:
        """K, in N/m, likewise."""
        return _array(self._told["system"]["stiffness"])

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the estimated parameters, in the order of `estimated`."""
        return _array(self._told["covariance"]["matrix"])

    @property
    def estimated(self) -> tuple[str, ...]:
        """Names of the parameters that were not given, in the order of `covariance`."""
        return tuple(self._told["covariance"]["parameters"])

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Modes by rising frequency, with standard errors."""
        return self.machine().modes

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Every check of the data and of the fit, in the order in which they were made."""
        return tuple(
            Finding(
                when=row["when"],
                record=row["record"],
                subject=row["subject"],
                verdict=row["verdict"],
                value=row["value"],
                text=row["text"],
                numbers=MappingProxyType(row["finding"]),
            )
            for row in self._told["checks"]
        )

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that are not good."""
        return tuple(check for check in self.findings if check.verdict != "good")

    @property
    def fit(self) -> Mapping[str, Any]:
        """Quality of the fit: ``nrmse``, ``unexplained_motion``, ``condition_number`` …"""
        return MappingProxyType(self._told["fit"])

    @property
    def validation(self) -> Validation | None:
        """Prediction of the record given as ``validate``."""
        told = self.to_dict()["validation"]
        return None if told is None else Validation._of(told)

    def machine(self) -> Machine:
        """Return M, C and K with the covariance of their entries."""
        return Machine._of(self._inner.machine())

    def validate(
        self,
        *sources: object,
        validate_start: int | None = None,
        validate_samples: int | None = None,
        **record: Unpack[RecordOptions],
    ) -> Validation:
        """Predict a record that was not fitted.

        Parameters
        ----------
        *sources, **record
            The record, as in `identify`.
        validate_start, validate_samples : int, optional
            First sample to predict, counted from 1, and their number.

        Raises
        ------
        MechidError
            If the record does not fit the machine, or the machine is unstable.
        """
        other = one(sources, "validate", record)
        samples = json.dumps({"start": validate_start, "samples": validate_samples})
        return Validation._of(json.loads(self._inner.validate(other._inner, samples)))

    def to_json(self) -> str:
        """Return the result as the program prints it with ``--json``."""
        return self._inner.to_json()

    def __str__(self) -> str:
        return self._inner.text()

    def __repr__(self) -> str:
        values = ", ".join(f"{p.name}={p.value:.6g} {p.unit}" for p in self.parameters.values())
        return f"<Identified {self._told['file']!r}: {values}>"


@final
class Machine(Result):
    """M, C and K, with the covariance of those of their entries that were identified.

    Parameters
    ----------
    mass, damping, stiffness : array_like
        Numbers, or matrices of shape (degrees of freedom, degrees of freedom), in kg, N·s/m and N/m,
        taken as exactly known. They need not be symmetric.

    Raises
    ------
    MechidError
        If the matrices are not square, of one size and finite, or M is singular.
    """

    _inner: _mechid.Machine

    def __init__(self, mass: ArrayLike, damping: ArrayLike, stiffness: ArrayLike) -> None:
        given = {"mass": mass, "damping": damping, "stiffness": stiffness}
        inner = _mechid.Machine.known(*(_square(name, values) for name, values in given.items()))
        self.__dict__["_inner"] = inner

    @classmethod
    def _of(cls, inner: _mechid.Machine) -> Machine:
        machine = cls.__new__(cls)
        machine.__dict__["_inner"] = inner
        return machine

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Machine:
        """Read a machine from the JSON of an identification, or from a description.

        Raises
        ------
        MechidError
            If the file cannot be read or describes no machine.
        """
        return cls._of(_mechid.Machine.read(os.fspath(path)))

    @property
    def name(self) -> str:
        """Where the machine comes from."""
        return self._inner.name

    @property
    def is_exact(self) -> bool:
        """Whether the machine is taken as exactly known."""
        return self._inner.is_exact

    @property
    def mass(self) -> NDArray[np.float64]:
        """M, in kg, shape (degrees of freedom, degrees of freedom)."""
        return self._inner.mass

    @property
    def damping(self) -> NDArray[np.float64]:
        """C, in N·s/m, likewise."""
        return self._inner.damping

    @property
    def stiffness(self) -> NDArray[np.float64]:
        """K, in N/m, likewise."""
        return self._inner.stiffness

    @cached_property
    def _modal(self) -> tuple[str, str]:
        return self._inner.modal()

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Modes by rising frequency, with standard errors where the machine was identified.

        Raises
        ------
        MechidError
            If the machine has no modes.
        """
        return tuple(_mode(row) for row in self._told["modes"])

    def state_space(
        self, output: Literal["displacement", "velocity", "acceleration"] = "displacement"
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return A, B, C and D for the state [x, ẋ], the input F and the output chosen.

        ``scipy.signal.StateSpace(*machine.state_space())`` takes them.
        """
        a, b = self._inner.state_matrices()
        n = b.shape[1]
        rows = {"displacement": np.eye(2 * n)[:n], "velocity": a[:n], "acceleration": a[n:]}
        if output not in rows:
            raise ValueError(f"`output` is one of {', '.join(rows)}, got {output!r}")
        d = b[n:] if output == "acceleration" else np.zeros((n, n))
        return a, b, rows[output], d

    def to_json(self) -> str:
        """Return the modes and the system as ``mechid modal --json`` prints them."""
        return self._modal[0]

    @property
    def remarks(self) -> tuple[str, ...]:
        """Nothing: a machine has no remarks."""
        return ()

    @property
    def settings(self) -> dict[str, Any]:
        """Nothing: a machine has no settings."""
        return {}

    def __str__(self) -> str:
        return self._modal[1]

    def __repr__(self) -> str:
        return f"<Machine {self.name!r}, degrees of freedom: {len(self.mass)}>"


def one(sources: Sequence[object], door: str, record: RecordOptions) -> Measurement:
    """Return the only record that a call names."""
    found = measurements(sources, door, record)
    if len(found) != 1:
        raise TypeError(f"{door} takes one record, got {len(found)}")
    return found[0]


def _mode(row: dict[str, Any]) -> Mode:
    shape = row["shape"]
    errors = [entry["standard_error"] for entry in shape]
    return Mode(
        oscillates=row["oscillates"],
        natural_frequency_hz=_uncertain(row["natural_frequency_hz"]),
        damped_frequency_hz=_uncertain(row["damped_frequency_hz"]),
        damping_ratio=_uncertain(row["damping_ratio"]),
        eigenvalue=complex(*row["eigenvalue"]),
        shape=np.array([complex(*entry["value"]) for entry in shape]),
        shape_std_error=None if None in errors else np.array([complex(*e) for e in errors]),
    )


def _uncertain(row: dict[str, Any]) -> Uncertain:
    interval = row["interval"]
    return Uncertain(
        value=_number(row["value"]),
        std_error=row["standard_error"],
        interval=None if interval is None else (interval[0], interval[1]),
    )


def _number(value: float | None) -> float:
    # JSON has no infinity.
    return float("inf") if value is None else value


def _array(rows: list[list[float | None]]) -> NDArray[np.float64]:
    return np.array([[_number(value) for value in row] for row in rows], dtype=np.float64)


def _square(name: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(values)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"`{name}` holds {array.dtype}, not real numbers")
    if array.ndim not in (0, 2):
        raise ValueError(f"`{name}` is a number or a matrix, got {array.ndim} dimensions")
    return np.array(array.reshape(array.shape or (1, 1)), dtype=np.float64)

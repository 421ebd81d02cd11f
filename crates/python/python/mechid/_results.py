"""Results of the analyses; they never change."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NoReturn, Protocol, Unpack, final

import numpy as np

from . import _mechid
from ._errors import MechidError
from ._figures import Figure, MatrixFigure, read_page
from ._mapping import ReadOnly
from ._records import Measurement, RecordOptions, Window, measurements, only_window

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray
    from pandas import DataFrame  # type: ignore[import-untyped]
    from xarray import Dataset


def labelled() -> Any:
    """Return the module that makes xarray datasets."""
    try:
        from . import _labelled
    except ImportError as error:
        raise ImportError(
            f'this function needs {error.name or "xarray"}, which is not installed: pip install "mechid[tables]"'
        ) from None
    return _labelled


def _pandas() -> Any:
    """Return pandas."""
    try:
        import pandas
    except ImportError:
        raise ImportError("this function needs pandas, which is not installed: pip install pandas") from None
    return pandas


@final
@dataclass(frozen=True, slots=True)
class Uncertain:
    """A number with its standard error and 95 % confidence interval, in its unit.

    Standard error and interval are None for a number that is known.
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
        Standard error of the value; None for a value that was given.
    unit : str
        SI unit.
    matrix : str
        ``"mass"``, ``"damping"`` or ``"stiffness"``.
    row, column : int
        Row and column in the matrix, counted from 1.
    known : bool
        Whether the value was given and not estimated.
    """

    name: str
    value: float
    std_error: float | None
    unit: str
    matrix: str
    row: int
    column: int
    known: bool
    _found: _mechid.Identified | _mechid.IdentifiedResponses = field(repr=False, compare=False)

    def __float__(self) -> float:
        return self.value

    def __copy__(self) -> Parameter:
        return self

    def __deepcopy__(self, memo: object) -> Parameter:
        return self

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        from ._stored import stored_intervals

        numbers = (self.name, self.value, self.std_error, self.unit, self.matrix, self.row, self.column, self.known)
        return type(self), (*numbers, stored_intervals(self._found, [self.name]))

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
        Whether the mode is underdamped.
    natural_frequency_hz, damped_frequency_hz : Uncertain
        Natural and damped frequency, in Hz.
    damping_ratio : Uncertain
        Damping ratio, a pure number.
    eigenvalue : complex
        Eigenvalue, in rad/s.
    shape : array of complex
        Mode shape, with one entry per degree of freedom; the largest is 1.
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
        Whether the data were checked before the fit, or the residual after it.
    record : str or None
        The record, if there are several.
    subject : str
        Subject of the check.
    verdict : {"good", "doubtful", "bad"}
        Result of the check.
    value : float or None
        The number that determines the verdict; None if it is infinite.
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
    """Accuracy with which an identified machine predicts a record that was not fitted.

    Attributes
    ----------
    fit_percent : mapping of str to float
        Predicted part of each channel, in per cent; 100 is perfect.
    values : mapping
        All values, as in the JSON of the program.
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
        return cls(ReadOnly(fit), ReadOnly(told))


class Result:
    """Common part of all results; they never change."""

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"a result never changes: `{name}` cannot be set")

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"a result never changes: `{name}` cannot be deleted")

    @cached_property
    def _told(self) -> dict[str, Any]:
        told: dict[str, Any] = json.loads(self.to_json())
        return told

    def __copy__(self) -> Result:
        return self

    def __deepcopy__(self, memo: object) -> Result:
        return self

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        from ._stored import restored, stored

        return restored, (type(self), stored(self.__dict__))

    def to_json(self) -> str:
        """Return the JSON that the program prints with ``--json``."""
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """Return the result as dictionaries, lists and numbers, with the structure of `to_json`."""
        told: dict[str, Any] = json.loads(self.to_json())
        return told

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks to read before using the numbers."""
        return self._remarks()

    def _remarks(self) -> tuple[str, ...]:
        return tuple(self._told["remarks"])

    @property
    def settings(self) -> dict[str, Any]:
        """Settings that repeat the analysis."""
        settings: dict[str, Any] = self.to_dict()["analysis"]
        return settings


class Bare(Result):
    """A result without remarks and settings."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Empty: this result has no remarks."""
        return ()

    @property
    def settings(self) -> dict[str, Any]:
        """Empty: this result has no settings."""
        return {}


class _Compiled(Protocol):
    """Methods that every compiled result has."""

    def to_json(self) -> str: ...
    def text(self) -> str: ...
    def svg(self) -> str: ...
    def html(self) -> str: ...
    def page(self, texts: Mapping[str, object]) -> str: ...


def framed(page: str, text: str) -> str:
    """Return a page above a text, as an element of a notebook."""
    # The page is a separate document, whose script and style do not affect the notebook.
    frame = '<iframe sandbox="allow-scripts" srcdoc="{}" width="100%" height="640" style="border:0"></iframe>'
    return f"<div>{frame.format(html.escape(page))}{_text_element(text)}</div>"


def _text_element(text: str) -> str:
    return f"<pre>{html.escape(text)}</pre>"


class Plotted:
    """A result with figures to draw with Matplotlib."""

    # Names of the figures that show a result best, in order.
    _usual: ClassVar[tuple[str, ...]] = ()

    @property
    def figures(self) -> Mapping[str, Figure]:
        """Figures by their names."""
        raise NotImplementedError

    def plot(self, name: str | None = None, member: str | int | None = None, **options: Any) -> list[Axes]:
        """Draw one of the `figures` with Matplotlib and return its axes.

        Parameters
        ----------
        name : str, optional
            Name of the figure. Default: the one that shows the result best.
        member : str or int, optional
            Figure of a set, such as the response to one of the forces, by its name or its number
            from 1. Default: the first.
        **options
            Options of ``plot`` of the figure: ``ax``, ``panel``, and for responses per unit force
            ``show``, ``quantity``, ``scale`` and ``phase``.

        Raises
        ------
        KeyError
            If there is no such figure, member or panel.
        ValueError
            If a choice has no such value, or the number of axes differs from the number of panels.
        MechidError
            If there is nothing to draw.
        ImportError
            If Matplotlib is not installed: ``pip install "mechid[plot]"``.
        """
        figures = self.figures
        if name is None:
            name = next((one for one in (*self._usual, *figures) if one in figures), "")
        if name not in figures:
            raise KeyError(f"no figure {name!r}: there are {', '.join(figures) or 'none'}")
        return figures[name].plot(*(() if member is None else (member,)), **options)


class Drawn(Result, Plotted):
    """A result for which the program draws a figure."""

    @property
    def _compiled(self) -> _Compiled:
        inner: _Compiled = self.__dict__["_inner"]
        return inner

    def to_json(self) -> str:
        """Return the JSON that the program prints with ``--json``."""
        return self._compiled.to_json()

    def to_svg(self) -> str:
        """Return the figure that the program draws with ``--plot``, as SVG.

        Raises
        ------
        MechidError
            If there is nothing to draw.
        """
        return self._compiled.svg()

    def report(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        title: str | None = None,
        about: Mapping[str, str] | None = None,
    ) -> str:
        """Return an HTML page of the result with a heading and details, and write it if a path is given.

        Parameters
        ----------
        path : path, optional
            File to write the page into.
        title : str, optional
            Heading. Default: the name of the record.
        about : mapping of str to str, optional
            Further lines of the page, such as sensors, operator, date, place and comment. Details
            in the head of the record are shown, too.

        Raises
        ------
        MechidError
            If the result cannot be drawn.
        """
        return self._written(path, title=title, about=about)

    def _written(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        title: str | None = None,
        about: Mapping[str, str] | None = None,
        geometry: str | os.PathLike[str] | None = None,
        reconstruct_force: bool = False,
    ) -> str:
        texts = {
            "title": title,
            "about": [(name, value) for name, value in (about or {}).items()],
            "record": self._record if os.path.isfile(self._record) else "",
            "geometry": None if geometry is None else os.fspath(geometry),
            "reconstruct_force": reconstruct_force,
        }
        page = self._compiled.page(texts)
        if path is not None:
            with open(path, "w", encoding="utf-8") as file:
                file.write(page)
        return page

    @property
    def _record(self) -> str:
        """First record, whose head may contain further details; empty without a record."""
        fields = self._told
        first = (fields.get("records") or fields.get("tests") or [fields])[0]
        return str(first.get("file", "") if isinstance(first, dict) else first)

    def to_html(self) -> str:
        """Return the figure as an HTML page, which has zoom and cursor and loads no other file.

        Raises
        ------
        MechidError
            If there is nothing to draw.
        """
        return self._compiled.html()

    @property
    def _page(self) -> str:
        return self._written()

    @cached_property
    def figures(self) -> Mapping[str, Figure]:
        """Figures of the page of the result by their names, to draw with Matplotlib.

        Raises
        ------
        MechidError
            If there is nothing to draw.
        """
        return read_page(self._page)

    def _repr_html_(self) -> str:
        try:
            return framed(self.to_html(), str(self))
        except MechidError:
            return _text_element(str(self))

    def __str__(self) -> str:
        return self._compiled.text()


class Shaped(Drawn):
    """A result with modes, whose shapes can be drawn on a geometry and written."""

    def report(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        title: str | None = None,
        about: Mapping[str, str] | None = None,
        geometry: str | os.PathLike[str] | None = None,
    ) -> str:
        """Return one HTML page with the whole result, and write it if a path is given.

        Parameters
        ----------
        path, title, about : optional
            File to write the page into, its heading, and further lines, as for the other results.
        geometry : path, optional
            Points of the channels, on which the mode shapes are drawn: a universal file (datasets
            15 or 2411, and 82), or a table with rows ``name,x,y,z`` in m and ``line,name,name``.
            Default: a row or a grid from the names of the channels.

        Raises
        ------
        MechidError
            If the result cannot be drawn, or a channel has no point in the geometry.
        """
        if geometry is not None:
            self._universal_file(geometry)
        return self._written(path, title=title, about=about, geometry=geometry)

    def write_shapes(
        self, path: str | os.PathLike[str], *, geometry: str | os.PathLike[str] | None = None
    ) -> None:
        """Write geometry and complex mode shapes into a universal file (datasets 164, 15, 82, 55; SI units).

        Parameters
        ----------
        path : path
            The file.
        geometry : path, optional
            Points of the channels, as in `report`.

        Raises
        ------
        MechidError
            If no mode oscillates, there are fewer than two channels, or a channel has no point.
        """
        text = self._universal_file(geometry)
        with open(path, "w", encoding="utf-8", newline="") as file:
            file.write(text)

    def _universal_file(self, geometry: str | os.PathLike[str] | None) -> str:
        text = _mechid.shapes_file(self.to_json(), None if geometry is None else os.fspath(geometry))
        if text is None:
            raise MechidError(
                "no mode shapes can be drawn: at least one mode must oscillate, at least two channels are needed, "
                "and `geometry`, if given, must have a point for each channel",
                "Settings",
            )
        return text


@final
@dataclass(frozen=True, slots=True)
class Receptances:
    """Measured and identified receptance of a machine.

    Attributes
    ----------
    frequency_hz : array
        Frequencies, in Hz.
    measured : array of complex
        Response per unit force in m/N, shape (frequencies, responses, forces); NaN where another
        force acts at the same frequency.
    model : array of complex
        Receptance of the identified machine, in the same shape; NaN for forces for which it is not
        known (`unscaled`).
    """

    frequency_hz: NDArray[np.float64]
    measured: NDArray[np.complex128]
    model: NDArray[np.complex128]

    def __repr__(self) -> str:
        frequencies, responses, forces = self.measured.shape
        return f"<Receptances: {frequencies} frequencies, responses: {responses}, forces: {forces}>"


class Estimated(Drawn):
    """A machine with the uncertainty of its parameters, and the checks of the identification."""

    _inner: _mechid.Identified | _mechid.IdentifiedResponses

    @cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """Entries of M, C and K by name, with standard errors.

        Entries of equations of motion whose scale is not known are omitted; see `unscaled`.
        """
        rows = self._told["parameters"]
        return ReadOnly({row["name"]: self._parameter(row) for row in rows})

    @property
    def unscaled(self) -> Mapping[str, Any] | None:
        """Degrees of freedom without force and without known mass, and equations without scale.

        Keys ``degrees_of_freedom`` and ``equations``, counted from 1. None if M, C and K are known;
        otherwise the data determine only the modes.
        """
        told = self._told.get("unscaled")
        return None if told is None else ReadOnly(told)

    def to_frame(self) -> DataFrame:
        """Return the parameters as a pandas data frame, one row each: value, standard error, interval, unit.

        Raises
        ------
        ImportError
            If pandas is not installed: ``pip install pandas``.
        """
        pandas = _pandas()
        rows = self._told["parameters"]
        columns = ("value", "standard_error", "unit", "known")
        table = {column: [row[column] for row in rows] for column in columns}
        return pandas.DataFrame(table, index=pandas.Index([row["name"] for row in rows], name="parameter"))

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
        return self._matrix("mass")

    @property
    def damping(self) -> NDArray[np.float64]:
        """C, in N·s/m, shape (degrees of freedom, degrees of freedom)."""
        return self._matrix("damping")

    @property
    def stiffness(self) -> NDArray[np.float64]:
        """K, in N/m, shape (degrees of freedom, degrees of freedom)."""
        return self._matrix("stiffness")

    def _matrix(self, name: str) -> NDArray[np.float64]:
        if "system" not in self._told:
            # This call raises the exception that states why there is no machine.
            self.machine()
        return _array(self._told["system"][name])

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the estimated parameters, in the order of `estimated`."""
        return self._covariance[1]

    @property
    def estimated(self) -> tuple[str, ...]:
        """Names of the parameters that were not given, in the order of `covariance`."""
        return tuple(self._covariance[0])

    @cached_property
    def _covariance(self) -> tuple[list[str], NDArray[np.float64]]:
        names, covariance = self._inner.covariance()
        covariance.flags.writeable = False
        return names, covariance

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Modes by rising frequency, with standard errors."""
        return tuple(_mode(row) for row in self._told["modes"])

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Every check of the data and of the fit, in the order in which they were made."""
        return tuple(_finding(row) for row in self._told["checks"])

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that are not good."""
        return tuple(check for check in self.findings if check.verdict != "good")

    @property
    def fit(self) -> Mapping[str, Any]:
        """Quality of the fit: ``nrmse``, ``unexplained_motion``, ``condition_number`` …"""
        return ReadOnly(self._told["fit"])

    def machine(self) -> Machine:
        """Return M, C and K with the covariance of their entries.

        Raises
        ------
        MechidError
            If the data determine only the modes; see `unscaled`.
        """
        return Machine._of(self._inner.machine())

    def _values(self) -> str:
        return ", ".join(f"{p.name}={p.value:.6g} {p.unit}" for p in self.parameters.values())


@final
class Identified(Shaped, Estimated):
    """A machine identified from records.

    ``print`` shows the text of the program; `to_json` returns its JSON.
    """

    _usual = ("restoring-force", "receptance", "fit")

    def __init__(self, inner: _mechid.Identified) -> None:
        self.__dict__["_inner"] = inner

    _inner: _mechid.Identified

    @property
    def nonlinear(self) -> Mapping[str, Any] | None:
        """Nonlinear terms with their coefficients and standard errors; None for a linear system."""
        told = self.to_dict().get("nonlinear")
        return None if told is None else ReadOnly(told)

    @property
    def validation(self) -> Validation | None:
        """Prediction of the record given as ``validate``."""
        told = self.to_dict()["validation"]
        return None if told is None else Validation._of(told)

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
            First sample to predict, counted from 1, and number of samples.

        Raises
        ------
        MechidError
            If the record does not fit the machine, or the machine is unstable.
        """
        other = one(sources, "validate", record)
        samples = json.dumps({"start": validate_start, "samples": validate_samples})
        return Validation._of(json.loads(self._inner.validate(other._inner, samples)))

    @property
    def compared(self) -> Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Measured and predicted response of the first record by quantity, in SI units."""
        return ReadOnly({kind: (m, p) for kind, m, p in self._inner.compared()})

    @property
    def residual(self) -> Mapping[str, NDArray[np.float64]]:
        """Measured minus predicted response of the first record by quantity, in SI units.

        Shape (samples, degrees of freedom); the means are subtracted if a steady state was fitted.
        """
        return ReadOnly({kind: m - p for kind, m, p in self._inner.compared()})

    @cached_property
    def frf(self) -> Receptances:
        """Measured and identified receptance, at the frequencies at which it was measured.

        The frequencies are the fitted lines or, for a fit in the time domain, the lines of whole
        periods or of segments.

        Raises
        ------
        MechidError
            If the records show no receptance.
        """
        omega, measured, model = self._inner.receptances()
        n = len(self.modes[0].shape)
        arrays = (omega / (2 * np.pi), measured.reshape(-1, n, n), model.reshape(-1, n, n))
        for array in arrays:
            array.setflags(write=False)
        return Receptances(*arrays)

    @property
    def spectra(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.complex128]] | None:
        """Frequencies in Hz, force in N and displacement in m on the lines that were fitted.

        Arrays of shape (lines, degrees of freedom); None for a fit in the time domain.
        """
        found = self._inner.spectra()
        return None if found is None else (found[0] / (2 * np.pi), *found[1:])

    def report(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        title: str | None = None,
        about: Mapping[str, str] | None = None,
        geometry: str | os.PathLike[str] | None = None,
        reconstruct_force: bool = False,
    ) -> str:
        """Return one HTML page with the whole identification, and write it if a path is given.

        Parameters
        ----------
        path : path, optional
            File to write the page into.
        title : str, optional
            Heading. Default: the name of the record.
        about : mapping of str to str, optional
            Further lines of the page, such as sensors, operator, date, place and comment. Details
            in the head of the record are shown, too.
        geometry : path, optional
            Points of the channels, on which the mode shapes are drawn: a universal file (datasets
            15 or 2411, and 82), or a table with rows ``name,x,y,z`` in m and ``line,name,name``.
            Default: a row or a grid from the names of the channels.
        reconstruct_force : bool
            Whether to reconstruct the force with the identified machine, and compare it with the
            measured force.

        Raises
        ------
        MechidError
            If a record cannot be read again, the force cannot be reconstructed, or a channel has no point
            in the geometry.
        """
        if geometry is not None:
            self._universal_file(geometry)
        return self._written(
            path, title=title, about=about, geometry=geometry, reconstruct_force=reconstruct_force
        )

    def to_xarray(self) -> Dataset:
        """Return responses, receptances, and M, C and K with their covariance, as an xarray dataset
        with units.

        Raises
        ------
        ImportError
            If xarray is not installed: ``pip install "mechid[tables]"``.
        """
        _labelled = labelled()

        dataset: Dataset = _labelled.identified(self)
        return dataset

    def __repr__(self) -> str:
        return f"<Identified {self._told['file']!r}: {self._values()}>"


@final
class IdentifiedResponses(Estimated):
    """A machine identified from tables of frequency responses.

    ``print`` shows the text of the program; `to_json` returns its JSON.
    """

    def __init__(self, inner: _mechid.IdentifiedResponses) -> None:
        self.__dict__["_inner"] = inner

    _inner: _mechid.IdentifiedResponses

    @property
    def points(self) -> tuple[str, ...]:
        """Points of the responses, one per degree of freedom."""
        return tuple(self._told["points"])

    def __repr__(self) -> str:
        return f"<IdentifiedResponses {self._told['files']!r}: {self._values()}>"


@final
class IdentifiedBearing(Drawn):
    """The coefficients of a journal bearing, from tests on a rig.

    ``print`` shows the text of the program; `to_json` returns its JSON.
    """

    _inner: _mechid.Answer

    def __init__(self, inner: _mechid.Answer) -> None:
        self.__dict__["_inner"] = inner

    @cached_property
    def coefficients(self) -> Mapping[str, Uncertain]:
        """Eight or twelve coefficients by name, ``"kxx"`` to ``"myy"``, in N/m, N·s/m and kg."""
        return ReadOnly({row["name"]: _uncertain(row) for row in self._told["coefficients"]})

    @property
    def stiffness(self) -> NDArray[np.float64]:
        """K, in N/m, shape (2, 2)."""
        return self._matrix("k")

    @property
    def damping(self) -> NDArray[np.float64]:
        """C, in N·s/m, shape (2, 2)."""
        return self._matrix("c")

    @property
    def mass(self) -> NDArray[np.float64]:
        """M, in kg, shape (2, 2); zero if eight coefficients were identified."""
        return self._matrix("m")

    def _matrix(self, kind: str) -> NDArray[np.float64]:
        names = (f"{kind}{entry}" for entry in ("xx", "xy", "yx", "yy"))
        found = (self.coefficients.get(name) for name in names)
        return np.array([0.0 if one is None else one.value for one in found]).reshape(2, 2)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the coefficients, in the order of `coefficients`."""
        return _array(self._told["covariance"]["matrix"])

    @cached_property
    def dimensionless(self) -> Mapping[str, Uncertain] | None:
        """Coefficients divided by W/c, W/(c Ω) and W/(c Ω²), with load W, clearance c and speed Ω;
        None without load or clearance."""
        told = self._told["dimensionless"]
        if told is None:
            return None
        return ReadOnly({row["name"]: _uncertain(row) for row in told["coefficients"]})

    @property
    def whirl_frequency_ratio(self) -> Uncertain | None:
        """Ratio of the whirl frequency of a rigid rotor to the frequency of rotation; None without
        whirl."""
        return self._of_rotor("whirl_frequency_ratio")

    @property
    def critical_mass(self) -> Uncertain | None:
        """Mass per bearing above which a rigid rotor is unstable, in kg; None if there is no such
        mass."""
        return self._of_rotor("critical_mass")

    def _of_rotor(self, name: str) -> Uncertain | None:
        told = (self._told["stability"] or {}).get(name)
        return None if told is None else _uncertain(told)

    @cached_property
    def checks(self) -> tuple[Finding, ...]:
        """Findings on the data before the fit and on the residual after it."""
        return tuple(_finding(row) for row in self._told["checks"])

    def ross(self, release: int = 2) -> dict[str, list[float]]:
        """Return keyword arguments of ``ross.BearingElement``: coefficients in its axes, and the speed in rad/s.

        The load acts along x here and along −y in ROSS. Releases 1 and 2 of ROSS call the speed
        ``frequency``, release 3 calls it ``speed``.
        """
        turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
        arguments = {"frequency" if release < 3 else "speed": [2.0 * np.pi * (self._told["rotation_hz"] or 0.0)]}
        for kind in "kcm":
            matrix = turn @ self._matrix(kind) @ turn.T
            for entry, value in zip(("xx", "xy", "yx", "yy"), matrix.ravel(), strict=True):
                arguments[kind + entry] = [float(value) + 0.0]
        return arguments

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={one.value:.6g}" for name, one in self.coefficients.items())
        return f"<IdentifiedBearing {self._told['tests']!r}: {values}>"


@final
class BearingTable(Bare, Drawn):
    """The coefficients of a bearing at several speeds and loads."""

    _inner: _mechid.Answer

    def __init__(self, inner: _mechid.Answer) -> None:
        self.__dict__["_inner"] = inner

    @property
    def rotation_hz(self) -> NDArray[np.float64]:
        """Speed of each row in Hz, rising; 0 at rest."""
        return np.array([row["rotation_hz"] or 0.0 for row in self._told["rows"]], dtype=np.float64)

    @property
    def load(self) -> NDArray[np.float64]:
        """Static load of each row in N; NaN if it is not stated."""
        loads = [row["load"] for row in self._told["rows"]]
        return np.array([np.nan if load is None else load for load in loads], dtype=np.float64)

    @property
    def rows(self) -> tuple[Mapping[str, Uncertain], ...]:
        """Coefficients of each row by name, ``"kxx"`` to ``"myy"``, in N/m, N·s/m and kg."""
        return tuple(
            ReadOnly({one["name"]: _uncertain(one) for one in row["coefficients"]})
            for row in self._told["rows"]
        )

    def __repr__(self) -> str:
        return f"<BearingTable: {len(self.rows)} speeds and loads>"


@final
class Machine(Bare, Shaped):
    """M, C and K, with the covariance of the entries that were identified.

    Parameters
    ----------
    mass, damping, stiffness : array_like
        Numbers, or matrices of shape (degrees of freedom, degrees of freedom), in kg, N·s/m and
        N/m; they are treated as exactly known and need not be symmetric.

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
            If the file cannot be read or does not describe a machine.
        """
        return cls._of(_mechid.Machine.read(os.fspath(path)))

    @property
    def name(self) -> str:
        """Source of the machine, such as the file it was read from."""
        return self._inner.name

    @property
    def is_exact(self) -> bool:
        """Whether the machine is treated as exactly known."""
        return self._inner.is_exact

    @property
    def mass(self) -> NDArray[np.float64]:
        """M, in kg, shape (degrees of freedom, degrees of freedom)."""
        return self._inner.mass

    @property
    def damping(self) -> NDArray[np.float64]:
        """C, in N·s/m, shape (degrees of freedom, degrees of freedom)."""
        return self._inner.damping

    @property
    def stiffness(self) -> NDArray[np.float64]:
        """K, in N/m, shape (degrees of freedom, degrees of freedom)."""
        return self._inner.stiffness

    def receptance(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the receptance in m/N, shape (frequencies, responses, forces).

        Raises
        ------
        MechidError
            If a frequency is not finite, or is an undamped resonance.
        """
        n = len(self.mass)
        omega = 2 * np.pi * np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
        return self._inner.receptances(omega.tolist()).reshape(-1, n, n)

    @cached_property
    def _modal(self) -> tuple[str, str]:
        return self._inner.modal()

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Modes by rising frequency, with standard errors if the machine was identified.

        Raises
        ------
        MechidError
            If the machine has no modes.
        """
        return tuple(_mode(row) for row in self._told["modes"])

    def state_space(
        self, output: Literal["displacement", "velocity", "acceleration"] = "displacement"
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return A, B, C and D for the state [x, ẋ], the input F and the requested output.

        ``scipy.signal.StateSpace(*machine.state_space())`` takes them.
        """
        a, b = self._inner.state_matrices()
        n = b.shape[1]
        rows = {"displacement": np.eye(2 * n)[:n], "velocity": a[:n], "acceleration": a[n:]}
        if output not in rows:
            raise ValueError(f"`output` must be one of {', '.join(rows)}, got {output!r}")
        d = b[n:] if output == "acceleration" else np.zeros((n, n))
        return a, b, rows[output], d

    def predict(
        self, *sources: object, settle: int | None = None, **record: Unpack[RecordOptions]
    ) -> Predicted:
        """Predict the response to the force of a record, and compare it with the measured response.

        With a period, the prediction is the steady state under the mean period, otherwise the
        response over the whole window. Between the samples the force is band-limited. Nonlinear
        terms are included.

        Parameters
        ----------
        *sources, **record
            The record, as in `identify`; arrays of force and, if measured, response.
        settle : int, optional
            Number of samples at the beginning to which the initial state is fitted; the errors
            exclude these samples. Default: at rest.

        Raises
        ------
        MechidError
            If the record does not fit the machine, or the response diverges.
        """
        found = one(sources, "predict", record)
        settings = json.dumps({"settle": settle})
        return Predicted(_mechid.predict_record(found._inner, self._inner, settings))

    def to_json(self) -> str:
        """Return the modes and the system as ``mechid modes --json`` prints them."""
        return self._modal[0]

    def __str__(self) -> str:
        return self._modal[1]

    def __repr__(self) -> str:
        return f"<Machine {self.name!r}, degrees of freedom: {len(self.mass)}>"


@final
class SelectedModes(Bare):
    """Some of the modes of a machine of any size."""

    _found: tuple[str, str]

    def __init__(self, found: tuple[str, str]) -> None:
        self.__dict__["_found"] = found

    @property
    def natural_frequency_hz(self) -> NDArray[np.float64]:
        """Natural frequencies, in Hz, shape (modes,), in the order of the search."""
        return self._each("natural_frequency_hz")

    @property
    def damping_ratio(self) -> NDArray[np.float64]:
        """Damping ratios, shape (modes,): negative if unstable, ±1 for a real eigenvalue."""
        return self._each("damping_ratio")

    @property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """Eigenvalues with an imaginary part of at least zero, in rad/s, shape (modes,)."""
        parts = self._each("eigenvalue").reshape(-1, 2)
        return parts[:, 0] + 1j * parts[:, 1]

    @property
    def residual(self) -> NDArray[np.float64]:
        """Norm of (λ²M + λC + K) φ relative to the size of its terms, shape (modes,)."""
        return self._each("residual")

    @property
    def is_rigid_body(self) -> NDArray[np.bool_]:
        """Whether a mode is a motion without restoring force, shape (modes,)."""
        return np.array([mode["is_rigid_body"] for mode in self._told["modes"]], dtype=np.bool_)

    @cached_property
    def shape(self) -> NDArray[np.complex128]:
        """Shapes, whose largest entry is 1: shape (degrees of freedom, modes)."""
        parts = self._each("shape").reshape(-1, self._told["degrees_of_freedom"], 2)
        return (parts[:, :, 0] + 1j * parts[:, :, 1]).T

    def _each(self, field: str) -> NDArray[np.float64]:
        return np.array([mode[field] for mode in self._told["modes"]], dtype=np.float64)

    def to_json(self) -> str:
        """Return the modes as ``mechid modes --modes COUNT --json`` prints them."""
        return self._found[0]

    def __str__(self) -> str:
        return self._found[1]

    def __repr__(self) -> str:
        return f"<SelectedModes: {len(self._told['modes'])}>"


@final
class FrequencyResponses(Drawn):
    """Frequency responses with coherence and standard errors."""

    _inner: _mechid.Answer

    def __init__(self, inner: _mechid.Answer) -> None:
        self.__dict__["_inner"] = inner

    @property
    def frequency_hz(self) -> NDArray[np.float64]:
        """Frequencies, in Hz."""
        return np.array(self._told["frequency_hz"], dtype=np.float64)

    @property
    def unit(self) -> str:
        """Unit of the responses, such as ``"m/N"``."""
        return str(self._told["unit"])

    def response(self, motion: int = 1, force: int = 1) -> NDArray[np.complex128]:
        """Return the complex response of a degree of freedom to the force on another, both counted
        from 1.

        Raises
        ------
        KeyError
            If there is no such pair.
        """
        row = self._row(motion, force)
        return np.array(row["real"], dtype=float) + 1j * np.array(row["imaginary"], dtype=float)

    def std_error(self, motion: int = 1, force: int = 1) -> NDArray[np.float64]:
        """Return the standard error, which real part, imaginary part and magnitude have in common.

        Raises
        ------
        KeyError
            If there is no such pair.
        """
        values = self._row(motion, force)["standard_error"]
        return np.array([_number(value) for value in values], dtype=np.float64)

    def coherence(self, motion: int = 1) -> NDArray[np.float64]:
        """Return the coherence: the part of the power of a response that is linear in the forces.

        Raises
        ------
        KeyError
            If there is no such degree of freedom.
        """
        for row in self._told["coherence"]:
            if row["motion"] == motion:
                return np.array(row["values"], dtype=np.float64)
        raise KeyError(motion)

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Response and force of each frequency response, by degrees of freedom counted from 1."""
        return tuple((row["motion"], row["force"]) for row in self._told["responses"])

    def _row(self, motion: int, force: int) -> dict[str, Any]:
        for row in self._told["responses"]:
            if (row["motion"], row["force"]) == (motion, force):
                found: dict[str, Any] = row
                return found
        raise KeyError((motion, force))

    def to_frame(self) -> DataFrame:
        """Return the responses as a pandas data frame, with a complex column for each response and
        force.

        Raises
        ------
        ImportError
            If pandas is not installed: ``pip install pandas``.
        """
        pandas = _pandas()
        index = pandas.Index(self.frequency_hz, name="frequency_hz")
        table = {pair: self.response(*pair) for pair in self.pairs}
        frame = pandas.DataFrame(table, index=index)
        frame.columns.names = ["motion", "force"]
        return frame

    def to_xarray(self) -> Dataset:
        """Return responses, standard errors and coherence, as an xarray dataset with units.

        Raises
        ------
        ImportError
            If xarray is not installed: ``pip install "mechid[tables]"``.
        """
        _labelled = labelled()

        dataset: Dataset = _labelled.frequency_responses(self)
        return dataset

    def __repr__(self) -> str:
        told = self._told
        return f"<FrequencyResponses {told['file']!r}: {len(told['frequency_hz'])} lines>"


@final
class Inspected(Drawn):
    """Contents of a record file."""

    _inner: _mechid.Answer
    _has_curves: bool

    def __init__(self, inner: _mechid.Answer, has_curves: bool) -> None:
        self.__dict__["_inner"] = inner
        self.__dict__["_has_curves"] = has_curves

    @property
    def _page(self) -> str:
        if not self._has_curves:
            raise MechidError("the result has no curves to draw: call `inspect` with `curves=True`", "Settings")
        return self.to_html()

    @property
    def channels(self) -> tuple[Mapping[str, Any], ...]:
        """Levels, strongest lines and period of each column."""
        return tuple(ReadOnly(row) for row in self._told["channels"])

    @property
    def fs(self) -> float | None:
        """Sampling rate, in Hz; None without a time axis."""
        sampling = self._told["sampling"]
        return None if sampling is None else float(sampling["rate_hz"])

    def __repr__(self) -> str:
        told = self._told
        return f"<Inspected {told['file']!r}: {told['columns']} columns, {told['samples']} samples>"


@final
class Decayed(Shaped):
    """Modes of a free response."""

    _inner: _mechid.Answer

    def __init__(self, inner: _mechid.Answer) -> None:
        self.__dict__["_inner"] = inner

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Modes by rising frequency; the entries of a shape are the channels."""
        return tuple(_mode(row) for row in self._told["modes"])

    @property
    def amplitudes(self) -> tuple[Uncertain, ...]:
        """Amplitude of each mode at the first sample used, in the channel where its shape is
        largest, in SI units."""
        return tuple(_uncertain(row["amplitude"]) for row in self._told["modes"])

    @property
    def energy_shares(self) -> NDArray[np.float64]:
        """Share of each mode in the sum of squares of all modes."""
        return np.array([row["energy_share"] for row in self._told["modes"]], dtype=np.float64)

    @property
    def decays(self) -> tuple[bool, ...]:
        """Whether the 95 % interval of the growth rate of each mode is below zero."""
        return tuple(bool(row["decays"]) for row in self._told["modes"])

    @property
    def explained(self) -> NDArray[np.float64]:
        """Share of the variance of each channel that the modes explain."""
        return np.array([row["explained"] for row in self._told["channels"]], dtype=np.float64)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks to read before using the numbers."""
        return tuple(self._told["remarks"])

    def __repr__(self) -> str:
        found = ", ".join(f"{mode.natural_frequency_hz.value:.5g} Hz" for mode in self.modes)
        return f"<Decayed {self._told['file']!r}: {found}>"


@final
class Modes(Shaped):
    """Modes of a test with forces, or of an ambient record."""

    _inner: _mechid.Answer

    def __init__(self, inner: _mechid.Answer) -> None:
        self.__dict__["_inner"] = inner

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Modes by rising frequency; the entries of a shape are the responses."""
        return tuple(_mode(row) for row in self._told["modes"])

    @property
    def participations(self) -> NDArray[np.complex128]:
        """Participation of each mode (rows) at each force; the largest of a mode is 1."""
        rows = [[complex(*e["value"]) for e in row["participation"]] for row in self._told["modes"]]
        return np.array(rows, dtype=np.complex128)

    @property
    def driven_shares(self) -> NDArray[np.float64]:
        """Share of the motion of each mode due to the measured forces; NaN without forces."""
        shares = [row["driven_share"] for row in self._told["modes"]]
        return np.array([np.nan if share is None else share for share in shares], dtype=np.float64)

    @property
    def mac(self) -> NDArray[np.float64]:
        """Modal assurance criterion of every pair of shapes."""
        return np.array(self._told["mac"], dtype=np.float64)

    @property
    def explained(self) -> NDArray[np.float64]:
        """Share of the variance of each response that the model explains; NaN without forces."""
        shares = [row.get("variance_explained", np.nan) for row in self._told["outputs"]]
        return np.array(shares, dtype=np.float64)

    @property
    def dropped(self) -> tuple[Mapping[str, Any], ...]:
        """Candidates that are not modes: ``frequency_hz``, ``damping_ratio`` and ``reason`` of
        each."""
        return tuple(ReadOnly(row) for row in self._told["dropped"])

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks to read before using the numbers."""
        return tuple(self._told["notes"])

    def _remarks(self) -> tuple[str, ...]:
        return self.notes

    @property
    def checks(self) -> tuple[Mapping[str, Any], ...]:
        """Checks of data and modes: ``code``, ``passed``, ``value`` and ``text`` of each."""
        return tuple(ReadOnly(row) for row in self._told["checks"])

    @property
    def diagrams(self) -> Mapping[str, Any] | None:
        """Stabilisation diagram and mode indicator, if they were requested."""
        told = self._told.get("diagrams")
        return None if told is None else ReadOnly(told)

    def predict(
        self, *sources: object, settle: int | None = None, **record: Unpack[RecordOptions]
    ) -> Predicted:
        """Predict the response to the forces of a record in the band of the modes, and compare it.

        With a period, the prediction is the steady state under the mean period, otherwise the
        response over the whole window. Between the samples the forces are band-limited.

        Parameters
        ----------
        *sources, **record
            The record, as in `modes`; arrays of forces and, if measured, responses.
        settle : int, optional
            Number of samples at the beginning to which the initial motion is fitted; the errors
            exclude these samples. Default: at rest.

        Raises
        ------
        MechidError
            If the modes are not from a test with forces, or the record has other columns.
        """
        found = one(sources, "predict", record)
        settings = json.dumps({"settle": settle})
        return Predicted(_mechid.predict_record(found._inner, system_of(self), settings))

    def to_frame(self) -> DataFrame:
        """Return the modes as a pandas data frame, one row each: frequency and damping ratio with
        their errors.

        Raises
        ------
        ImportError
            If pandas is not installed: ``pip install pandas``.
        """
        pandas = _pandas()
        frequencies = [mode.natural_frequency_hz for mode in self.modes]
        ratios = [mode.damping_ratio for mode in self.modes]
        table = {
            "natural_frequency_hz": [one.value for one in frequencies],
            "natural_frequency_hz_standard_error": [one.std_error for one in frequencies],
            "damping_ratio": [one.value for one in ratios],
            "damping_ratio_standard_error": [one.std_error for one in ratios],
            "driven_share": self.driven_shares,
        }
        return pandas.DataFrame(table, index=pandas.RangeIndex(1, len(frequencies) + 1, name="mode"))

    def __repr__(self) -> str:
        frequencies = ", ".join(f"{mode.natural_frequency_hz.value:.5g} Hz" for mode in self.modes)
        return f"<Modes: {frequencies}>"


@final
class IdentifiedElements(Drawn):
    """Identified coefficients of a machine of named elements."""

    _inner: _mechid.IdentifiedElements

    def __init__(self, inner: _mechid.IdentifiedElements) -> None:
        self.__dict__["_inner"] = inner

    @cached_property
    def parameters(self) -> Mapping[str, Uncertain]:
        """Unknowns by name: value, standard error and interval, in SI units.

        The standard error is None for an unknown at its bound, and for one that the data do not
        determine.
        """
        return ReadOnly({row["name"]: _unknown(row) for row in self._told["parameters"]})

    @property
    def priors(self) -> Mapping[str, Mapping[str, Any]]:
        """Priors by name: ``mean``, ``standard_deviation``, ``share`` of the information, ``p_value``."""
        rows = [row for row in self._told["parameters"] if row["prior"] is not None]
        return ReadOnly({row["name"]: ReadOnly(row["prior"]) for row in rows})

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of the unknowns at a bound; without the bound, their estimates would lie beyond
        it."""
        return tuple(row["name"] for row in self._told["parameters"] if row["at_bound"])

    @property
    def combinations(self) -> tuple[str, ...]:
        """Combinations of unknowns that the data determine only together, a sentence each."""
        return tuple(row["text"] for row in self._told["combinations"])

    @property
    def minima(self) -> tuple[Mapping[str, Any], ...]:
        """Minima at which the searches ended, the lowest first."""
        return tuple(ReadOnly(row) for row in self._told["minima"])

    @property
    def candidates(self) -> tuple[Mapping[str, Any], ...]:
        """Possible additional measurements, the best first."""
        return tuple(ReadOnly(row) for row in self._told.get("candidates", ()))

    @property
    def covariance(self) -> tuple[tuple[str, ...], NDArray[np.float64]]:
        """Names of the unknowns, and their covariance."""
        names, matrix = self._inner.covariance()
        matrix.flags.writeable = False
        return tuple(names), matrix

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Every check of the data and of the fit."""
        return tuple(_finding(row) for row in self._told["checks"])

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that are not good."""
        return tuple(check for check in self.findings if check.verdict != "good")

    @property
    def notes(self) -> tuple[Mapping[str, Any], ...]:
        """Remarks to read before using the numbers: ``kind`` and the numbers of each."""
        return tuple(ReadOnly(row) for row in self._told["notes"])

    def _remarks(self) -> tuple[str, ...]:
        # The JSON has the numbers of each note; the text has its sentence.
        lines = str(self).splitlines()
        return tuple(line.removeprefix("note: ") for line in lines if line.startswith("note: "))

    def machine(self) -> Machine:
        """Return M, C and K with the covariance of their entries.

        Raises
        ------
        MechidError
            If an entry is not determined, or a degree of freedom has no mass.
        """
        return Machine._of(self._inner.machine())

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={p.value:.6g}" for name, p in self.parameters.items())
        return f"<IdentifiedElements: {values}>"


@final
class ModeComparison(Bare, Plotted):
    """Comparison of two sets of modes."""

    _found: tuple[str, str]

    def __init__(self, found: tuple[str, str]) -> None:
        self.__dict__["_found"] = found

    @property
    def pairs(self) -> tuple[Mapping[str, Any], ...]:
        """Corresponding modes: their numbers, frequencies, damping ratios, MAC and
        probabilities."""
        return tuple(ReadOnly(row) for row in self._told["pairs"])

    @property
    def only_first(self) -> tuple[int, ...]:
        """Numbers, from 1, of the modes of the first set without a partner."""
        return tuple(row["mode"] for row in self._told["only_first"])

    @property
    def only_second(self) -> tuple[int, ...]:
        """Numbers, from 1, of the modes of the second set without a partner."""
        return tuple(row["mode"] for row in self._told["only_second"])

    @property
    def points(self) -> tuple[str, ...]:
        """Points in both sets."""
        return tuple(self._told["points"])

    @property
    def mac(self) -> NDArray[np.float64]:
        """Modal assurance criterion of the modes of the first set (rows) with those of the second."""
        return np.array(self._told["mac"], dtype=np.float64)

    @property
    def figures(self) -> Mapping[str, Figure]:
        """Figure of the modal assurance criterion, ``"assurance"``, to draw with Matplotlib."""
        caption = "Similarity of the mode shapes: rows are the modes of the first set, columns those of the second."
        return ReadOnly({"assurance": MatrixFigure("assurance", caption, ("",), self.mac)})

    def to_json(self) -> str:
        """Return the JSON that ``mechid modes --compare FILE --json`` prints."""
        return self._found[0]

    def __str__(self) -> str:
        return self._found[1]

    def __repr__(self) -> str:
        return f"<ModeComparison: {len(self.pairs)} pairs>"


@final
class Sweep(Drawn):
    """Estimates and errors at many sampling steps."""

    _inner: _mechid.Answer

    def __init__(self, inner: _mechid.Answer) -> None:
        self.__dict__["_inner"] = inner

    @property
    def values(self) -> NDArray[np.float64]:
        """Values of the setting: NPI, rates in Hz, or decimations."""
        return np.array([point["setting"] for point in self._told["points"]], dtype=np.float64)

    @property
    def error(self) -> NDArray[np.float64]:
        """Relative error at each setting; NaN without an estimate."""
        errors = [point["error"] for point in self._told["points"]]
        return np.array([np.nan if error is None else error for error in errors], dtype=np.float64)

    @property
    def best(self) -> float:
        """Setting with the smallest error."""
        return float(self._told["best_setting"])

    @property
    def points(self) -> tuple[Mapping[str, Any], ...]:
        """All values at each setting."""
        return tuple(ReadOnly(point) for point in self._told["points"])

    def to_xarray(self) -> Dataset:
        """Return error and estimates at each setting, as an xarray dataset with units.

        Raises
        ------
        ImportError
            If xarray is not installed: ``pip install "mechid[tables]"``.
        """
        _labelled = labelled()

        dataset: Dataset = _labelled.sweep(self)
        return dataset

    def __repr__(self) -> str:
        return f"<Sweep {self._told['file']!r}: best at {self.best:g} of {len(self.values)} settings>"


@final
class Reconstructed(Drawn):
    """The force on a machine, and the method that reconstructed it."""

    _inner: _mechid.Reconstructed

    def __init__(self, inner: _mechid.Reconstructed) -> None:
        self.__dict__["_inner"] = inner

    @property
    def force(self) -> NDArray[np.float64]:
        """The force, shape (samples, degrees of freedom), in N; one period if the record has whole
        periods."""
        return self._inner.force

    @property
    def std_error(self) -> NDArray[np.float64] | None:
        """Standard error of the force, in the same shape; None if it is not known."""
        return self._inner.std_error

    @property
    def time(self) -> NDArray[np.float64]:
        """Instants of the samples, in s."""
        return np.arange(len(self.force)) / float(self._told["sample_rate_hz"])

    @property
    def spectrum(self) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Frequencies in Hz, and complex amplitudes, shape (frequencies, degrees of freedom), in N."""
        return self._inner.spectrum()

    def to_xarray(self) -> Dataset:
        """Return force, standard error and spectrum, as an xarray dataset with units.

        Raises
        ------
        ImportError
            If xarray is not installed: ``pip install "mechid[tables]"``.
        """
        _labelled = labelled()

        dataset: Dataset = _labelled.reconstructed(self)
        return dataset

    def __repr__(self) -> str:
        told = self._told
        return f"<Reconstructed {told['file']!r}: {told['method']}, {told['samples']} samples>"


@final
class Predicted(Result):
    """The response of a machine, or of modes, to the force of a record, and its error."""

    _inner: _mechid.Predicted

    def __init__(self, inner: _mechid.Predicted) -> None:
        self.__dict__["_inner"] = inner

    @cached_property
    def columns(self) -> Mapping[str, NDArray[np.float64]]:
        """Predicted responses by name, in m, m/s or m/s², one for each measured response.

        If the record has no responses: for a machine all displacements, called ``"displacement
        1"`` …; for modes all responses, with the names in the record of the test.
        """
        return ReadOnly(dict(self._inner.columns()))

    def _responses(self, quantity: str) -> NDArray[np.float64]:
        for name, values in self._inner.responses():
            if name == quantity:
                return values
        raise MechidError("modes predict only the responses of their test, which are in `columns`", "Settings")

    @property
    def displacement(self) -> NDArray[np.float64]:
        """Displacement of a machine, shape (samples, degrees of freedom), in m."""
        return self._responses("displacement")

    @property
    def velocity(self) -> NDArray[np.float64]:
        """Velocity of a machine, shape (samples, degrees of freedom), in m/s."""
        return self._responses("velocity")

    @property
    def acceleration(self) -> NDArray[np.float64]:
        """Acceleration of a machine, shape (samples, degrees of freedom), in m/s²."""
        return self._responses("acceleration")

    @property
    def channels(self) -> tuple[Mapping[str, Any], ...]:
        """Error of each measured channel: ``quantity``, ``degree_of_freedom``, ``rmse``, ``nrmse`` …"""
        return tuple(ReadOnly(row) for row in self.to_dict()["channels"])

    def to_json(self) -> str:
        """Return the JSON that the program prints with ``--json``."""
        return self._inner.to_json()

    def __str__(self) -> str:
        return self._inner.text()

    def __repr__(self) -> str:
        told = self._told
        return f"<Predicted {told['file']!r}: samples {told['first_sample']} to {told['last_sample']}>"


@final
class Simulation:
    """The record of a simulated experiment, with and without noise.

    Attributes
    ----------
    scheme : str
        Scheme that computed the response, with its parameters.
    fs : float
        Sampling rate, in Hz.
    force : array
        Measured force (with noise), shape (samples, degrees of freedom), in N.
    displacement, velocity, acceleration : array
        Measured response (with noise), shape (samples, outputs), in m, m/s and m/s².
    truth : mapping
        Force, displacement, velocity and acceleration without noise.
    """

    __slots__ = ("_machine", "acceleration", "displacement", "force", "fs", "scheme", "truth", "velocity")

    def __init__(self, found: _mechid._Simulated) -> None:
        self.scheme, self.fs, machine, (force, measured), (true_force, truth) = found
        self._machine = None if machine is None else Machine._of(machine)
        self.force = force
        kinds = dict(measured)
        self.displacement, self.velocity = kinds["displacement"], kinds["velocity"]
        self.acceleration = kinds["acceleration"]
        self.truth: Mapping[str, NDArray[np.float64]] = ReadOnly(
            {"force": true_force, **dict(truth)}
        )

    @property
    def machine(self) -> Machine:
        """The machine.

        Raises
        ------
        ValueError
            If the machine is large and has sparse matrices.
        """
        if self._machine is None:
            raise ValueError("the machine has large sparse matrices: take them from the description of the experiment")
        return self._machine

    def measurement(self, *quantities: str, **window: Unpack[Window]) -> Measurement:
        """Return force and the requested responses (default: the displacement) as a record."""
        only_window("Simulation.measurement", window)
        chosen: dict[str, Any] = {name: getattr(self, name) for name in quantities or ("displacement",)}
        return Measurement.from_arrays(self.force, fs=self.fs, **chosen, **window)

    def to_xarray(self) -> Dataset:
        """Return force and responses with noise and without, as an xarray dataset with units.

        Raises
        ------
        ImportError
            If xarray is not installed: ``pip install "mechid[tables]"``.
        """
        _labelled = labelled()

        dataset: Dataset = _labelled.simulation(self)
        return dataset

    def __repr__(self) -> str:
        return f"<Simulation: {len(self.force)} samples at {self.fs:g} Hz, {self.scheme}>"


@final
@dataclass(frozen=True, slots=True)
class Multisine:
    """One period of a multisine.

    Attributes
    ----------
    fs : float
        Sampling rate, in Hz.
    force : array
        The period, in N.
    lines : tuple of int
        Lines of the period with force.
    amplitudes, phases : array
        Amplitude and phase of each line, in N and rad: the force is the sum of amplitude · cos(2π
        line t / period + phase).
    rms, peak, crest_factor : float
        RMS value and peak in N, including values between samples, and their ratio.
    """

    fs: float
    force: NDArray[np.float64]
    lines: tuple[int, ...]
    amplitudes: NDArray[np.float64]
    phases: NDArray[np.float64]
    rms: float
    peak: float
    crest_factor: float

    @classmethod
    def _of(cls, fs: float, found: _mechid._Sampled) -> Multisine:
        force, lines, amplitudes, phases, measures = found
        return cls(fs, force, tuple(lines), amplitudes, phases, *measures)

    def __repr__(self) -> str:
        return f"<Multisine: {len(self.force)} samples at {self.fs:g} Hz, {len(self.lines)} lines, peak {self.peak:.5g} N>"


def machine_of(
    given: Machine | Estimated | IdentifiedElements | str | os.PathLike[str],
) -> Machine:
    """Return the machine that an argument names."""
    if isinstance(given, (Estimated, IdentifiedElements)):
        return given.machine()
    if isinstance(given, Machine):
        return given
    return Machine.read(given)


def system_of(
    given: Machine | Estimated | IdentifiedElements | Modes | str | os.PathLike[str],
) -> _mechid.Machine | _mechid.ModalSystem:
    """Return the machine or the modes that an argument names."""
    if isinstance(given, Modes):
        return _mechid.ModalSystem.from_json("the modes", given.to_json())
    if isinstance(given, (str, os.PathLike)):
        modes = _mechid.ModalSystem.read(given)
        if modes is not None:
            return modes
    return machine_of(given)._inner


def description_of(given: object) -> tuple[str, str | None] | None:
    """Return the experiment that an argument names: a file, or a name and JSON; None for anything
    else.

    A file is not read here, because the names of files in it are relative to its own folder.
    """
    if isinstance(given, Mapping) and "system" in given:
        return "the description", json.dumps(given, default=listed)
    if isinstance(given, (str, os.PathLike)) and os.fspath(given).lower().endswith(".json"):
        return os.fspath(given), None
    return None


def listed(value: object) -> object:
    """Return an array as lists, and a sparse matrix as its entries."""
    if hasattr(value, "tocoo"):
        entries = value.tocoo()
        if entries.shape[0] != entries.shape[1]:
            raise ValueError(f"a sparse matrix must be square, got shape {entries.shape}")
        rows, columns = np.asarray(entries.row) + 1, np.asarray(entries.col) + 1
        values = np.asarray(entries.data, dtype=np.float64)
        return {
            "size": int(entries.shape[0]),
            "rows": rows.tolist(),
            "columns": columns.tolist(),
            "values": values.tolist(),
        }
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"a description can hold only numbers, text, lists and matrices, got {type(value).__name__}")


def one(sources: Sequence[object], door: str, record: RecordOptions) -> Measurement:
    """Return the only record that a call names."""
    found = measurements(sources, door, record)
    if len(found) != 1:
        raise TypeError(f"{door} takes one record, got {len(found)} records")
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


def _finding(row: dict[str, Any]) -> Finding:
    return Finding(
        when=row["when"],
        record=row["record"],
        subject=row["subject"],
        verdict=row["verdict"],
        value=row["value"],
        text=row["text"],
        numbers=ReadOnly(row["finding"]),
    )


def _unknown(row: dict[str, Any]) -> Uncertain:
    low, high = row["interval"]
    # JSON has no infinity.
    interval = (float("-inf") if low is None else low, _number(high))
    return Uncertain(value=_number(row["value"]), std_error=row["standard_error"], interval=interval)


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
        raise ValueError(f"`{name}` must be a number or a matrix, got {array.ndim} dimensions")
    return np.array(array.reshape(array.shape or (1, 1)), dtype=np.float64)

"""Figures of the HTML pages: the numbers of a page, read from it and drawn with Matplotlib.

A page contains the numbers of its figures for its script. They are read here, so that every figure
of a page can be drawn with Matplotlib. As on the page, curves have single precision, phases four
digits and standard errors two; a curve of more than 8,192 points is reduced to its extremes.
"""

from __future__ import annotations

import base64
import html
import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from ._mapping import ReadOnly

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Values: TypeAlias = NDArray[np.float64]

Quantity: TypeAlias = Literal["receptance", "mobility", "accelerance"]
Show: TypeAlias = Literal["bode", "complex", "nyquist"]
Scale: TypeAlias = Literal["log", "linear", "decibel"]
Phase: TypeAlias = Literal["wrapped", "continuous"]

_FIGURE = re.compile(r'<figure id="figure-([^"]+)"(.*?)</figure>', re.DOTALL)
_NUMBERS = re.compile(r"<metadata>(.*?)</metadata>", re.DOTALL)
_SQUARE = re.compile(r'<g opacity="([\d.]+)">\s*<rect x="([\d.]+)" y="([\d.]+)"')
_CAPTION = re.compile(r"<figcaption>(.*?)</figcaption>", re.DOTALL)

# Responses per unit force, in the order of the derivatives of the displacement.
_ORDERS = (("Receptance", "m/N"), ("Mobility", "m/(s·N)"), ("Accelerance", "m/(s²·N)"))

# A relative error times this number is one in dB.
NEPER = 20 / math.log(10)

# Number of bytes of single precision with which a list is written.
_BYTES = {"h": 2, "m": 3, "f": 4}

# Largest displacement of a drawn mode, relative to the size of the structure, as on the page.
_DEFLECTION = 0.16

_KINDS = {"l": "line", "k": "marked line", "p": "points", "s": "stems", "b": "band"}


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis: quantity, unit, scale, and the range that the page shows."""

    label: str
    unit: str
    is_logarithmic: bool = False
    range: tuple[float, float] | None = None
    step: float | None = None

    @property
    def is_decibel(self) -> bool:
        """Whether the axis has levels in dB."""
        return self.unit.startswith("dB")

    @property
    def caption(self) -> str:
        """Quantity with its unit in parentheses."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


@dataclass(frozen=True, slots=True)
class Curve:
    """A curve: points in the units of the axes, and how they are drawn.

    ``kind`` is "line", "marked line", "points", "stems" or "band"; a band is between ``y`` and
    ``upper``. ``std_error`` has the standard errors of ``y``, and ``phase_deg`` the phases of a
    magnitude.
    """

    name: str
    kind: str
    x: Values
    y: Values
    upper: Values | None = None
    phase_deg: Values | None = None
    std_error: Values | None = None
    color: str = "#000000"
    width: float = 1.5
    dash: tuple[float, ...] = ()
    marker: str | None = None
    is_wrapped: bool = False


@dataclass(frozen=True, slots=True)
class Reference:
    """A straight line across a panel at one value of an axis."""

    name: str
    value: float
    is_horizontal: bool
    color: str
    dash: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Panel:
    """Axes with curves and reference lines."""

    title: str
    x: Axis
    y: Axis
    curves: tuple[Curve, ...]
    references: tuple[Reference, ...] = ()
    is_equal: bool = False


@dataclass(frozen=True)
class _Member:
    """Panels of one of the figures of a chart; each has a part: "m" (magnitude), "p" (phase) or
    none."""

    panels: tuple[Panel, ...]
    parts: tuple[str, ...]
    columns: int
    shares_x: bool


@dataclass(frozen=True)
class Chart:
    """Curves in one panel or several, as on a page; a chart with several members shows one at a
    time.

    Attributes
    ----------
    name : str
        Name of the figure, such as ``"receptance"``.
    caption : str
        Caption of the figure on the page.
    members : tuple of str
        Names of the figures to choose from, such as the responses to each force; one empty name if
        there is only one figure.
    """

    name: str
    caption: str
    members: tuple[str, ...]
    _drawn: tuple[_Member, ...] = field(repr=False)

    def panels(
        self,
        member: str | int = 1,
        *,
        show: Show = "bode",
        quantity: Quantity | None = None,
        scale: Scale | None = None,
        phase: Phase = "wrapped",
    ) -> tuple[Panel, ...]:
        """Return the panels with their curves, without drawing them; the parameters are those of `plot`.

        Raises
        ------
        KeyError
            If the figure has no such member.
        ValueError
            If a choice has no such value, or there are no responses per unit force to convert.
        """
        drawn = self._drawn[_index(self.members, member, "member")]
        _check("show", show, Show)
        _check("phase", phase, Phase)
        view = _View(drawn, show, quantity, scale, phase)
        panels: list[Panel] = []
        for panel, part in zip(drawn.panels, drawn.parts, strict=True):
            if part == "m":
                panels.extend(view.of(panel))
            elif part != "p":
                panels.append(panel)
        return tuple(panels)

    def plot(
        self,
        member: str | int = 1,
        *,
        panel: str | int | None = None,
        show: Show = "bode",
        quantity: Quantity | None = None,
        scale: Scale | None = None,
        phase: Phase = "wrapped",
        ax: Axes | Sequence[Axes] | None = None,
    ) -> list[Axes]:
        """Draw the figure with Matplotlib and return its axes, one for each panel.

        Parameters
        ----------
        member : str or int
            Name of the figure, or its number from 1.
        panel : str or int, optional
            The only panel to draw, by the quantity of its ordinate, such as ``"Phase"``, or by its
            number from 1. Default: all panels, or the first if ``ax`` is a single axes.
        show : {"bode", "complex", "nyquist"}
            Responses per unit force as magnitude and phase, as real and imaginary part, or as
            imaginary over real part.
        quantity : {"receptance", "mobility", "accelerance"}, optional
            Quantity of responses per unit force. Default: the measured one.
        scale : {"log", "linear", "decibel"}, optional
            Scale of the magnitude of responses per unit force.
        phase : {"wrapped", "continuous"}
            Phase of responses per unit force: between −180° and 180°, or without jumps.
        ax : matplotlib.axes.Axes or sequence of them, optional
            Axes to draw into, one for each panel. Default: those of a new figure.

        Raises
        ------
        KeyError
            If there is no such member or panel.
        ValueError
            If a choice has no such value, or the number of axes differs from the number of panels.
        ImportError
            If Matplotlib is not installed: ``pip install "mechid[plot]"``.
        """
        from ._drawing import draw_panels

        drawn = self._drawn[_index(self.members, member, "member")]
        panels = self.panels(member, show=show, quantity=quantity, scale=scale, phase=phase)
        if panel is None and ax is not None and not isinstance(ax, Sequence | np.ndarray):
            panel = 1
        if panel is not None:
            panels = (panels[_index([one.y.label for one in panels], panel, "panel")],)
        return draw_panels(panels, ax, drawn.columns, drawn.shares_x)


@dataclass(frozen=True)
class ShapeFigure:
    """Mode shapes on the points of a structure, in the same projection as on the page.

    Attributes
    ----------
    name, caption : str
        Name of the figure, and its caption on the page.
    members : tuple of str
        Names of the modes, with frequency and damping.
    points : tuple of str
        Names of the points.
    positions : array
        Coordinates of the points, shape (points, 3), in the unit of the geometry.
    lines : tuple of pairs of int
        Pairs of points, counted from 0, that a line joins.
    displacements : tuple of arrays of complex
        Displacement of each mode at the points along x, y and z, shape (points, 3), with four digits;
        the largest is 1.
    """

    name: str
    caption: str
    members: tuple[str, ...]
    points: tuple[str, ...]
    positions: Values
    lines: tuple[tuple[int, int], ...]
    displacements: tuple[NDArray[np.complex128], ...]
    _view: tuple[float, float] = field(repr=False)
    _colors: tuple[str, str, str] = field(repr=False)

    def plot(
        self,
        member: str | int = 1,
        *,
        phase_deg: float = 0.0,
        amplitude: float = 1.0,
        ax: Axes | None = None,
    ) -> list[Axes]:
        """Draw a mode over the structure at rest and return the axes.

        Parameters
        ----------
        member : str or int
            Name of the mode, or its number from 1.
        phase_deg : float
            Instant of the motion, in degrees: the largest deflection of a real mode is at 0.
        amplitude : float
            Deflection relative to the deflection on the page, which is 16 % of the size of the
            structure.
        ax : matplotlib.axes.Axes, optional
            Axes to draw into.

        Raises
        ------
        KeyError
            If there is no such mode.
        ImportError
            If Matplotlib is not installed: ``pip install "mechid[plot]"``.
        """
        from ._drawing import draw_shape

        at = _index(self.members, member, "mode")
        size = float(np.max(np.ptp(self.positions, axis=0))) or 1.0
        turned = np.real(self.displacements[at] * np.exp(1j * np.radians(phase_deg)))
        moved = self.positions + _DEFLECTION * size * amplitude * turned
        ends = self._projected(self.positions), self._projected(moved)
        return [draw_shape(ends, self.lines, self.points, self.members[at], self._colors, ax)]

    def _projected(self, positions: Values) -> Values:
        turn, tilt = self._view
        x, y, z = positions.T
        depth = np.sin(turn) * x + np.cos(turn) * y
        return np.stack([np.cos(turn) * x - np.sin(turn) * y, z * np.cos(tilt) + depth * np.sin(tilt)], axis=1)


@dataclass(frozen=True)
class MatrixFigure:
    """A matrix of numbers from 0 to 1, as squares: the modal assurance criterion of the mode shapes.

    Attributes
    ----------
    name, caption : str
        Name of the figure, and its caption on the page.
    members : tuple of str
        One empty name, because there is only one figure.
    values : array
        The numbers, shape (modes, modes); with an accuracy of 0.02 for a page that compares two
        sets of modes.
    """

    name: str
    caption: str
    members: tuple[str, ...]
    values: Values

    def plot(self, *, ax: Axes | None = None) -> list[Axes]:
        """Draw the matrix and return the axes.

        Raises
        ------
        ImportError
            If Matplotlib is not installed: ``pip install "mechid[plot]"``.
        """
        from ._drawing import draw_matrix

        return [draw_matrix(self.values, ax)]


Figure: TypeAlias = Chart | ShapeFigure | MatrixFigure


def read_page(page: str | os.PathLike[str]) -> Mapping[str, Figure]:
    """Return the figures of a page, given as HTML or as the path of its file, by their names."""
    text = page if isinstance(page, str) and page.lstrip().startswith("<!") else Path(page).read_text("utf-8")
    found: dict[str, Figure] = {}
    for name, content in _FIGURE.findall(text):
        caption = html.unescape(_text(_CAPTION, content))
        numbers = _text(_NUMBERS, content)
        if numbers:
            data = json.loads(html.unescape(numbers))
            found[name] = _chart(name, caption, data) if "v" in data else _shapes(name, caption, data)
        else:
            # The matrix is computed from the shapes of the page; a page that compares two sets has only shades.
            shapes = next((one for one in found.values() if isinstance(one, ShapeFigure)), None)
            values = _shades(content) if shapes is None else assurance(_rows(shapes))
            found[name] = MatrixFigure(name, caption, ("",), values)
    return ReadOnly(found)


def assurance(shapes: NDArray[np.complex128]) -> Values:
    """Return the modal assurance criterion of every pair of shapes; each row is a shape."""
    power = np.sum(np.abs(shapes) ** 2, axis=1)
    values: Values = np.abs(shapes.conj() @ shapes.T) ** 2 / np.outer(power, power)
    return values


def _rows(shapes: ShapeFigure) -> NDArray[np.complex128]:
    return np.array([one.ravel() for one in shapes.displacements])


def _shades(content: str) -> Values:
    """Return the numbers of a matrix of squares from the opacity of the squares, to 0.02."""
    squares = [(float(y), float(x), float(opacity)) for opacity, x, y in _SQUARE.findall(content)]
    columns = len({x for _, x, _ in squares})
    values = np.array([opacity for _, _, opacity in sorted(squares)]).reshape(-1, columns)
    return np.clip((values - 0.06) / 0.4, 0.0, 1.0)


def _text(pattern: re.Pattern[str], content: str) -> str:
    found = pattern.search(content)
    return found.group(1) if found else ""


def _index(names: Sequence[str], wanted: str | int, what: str) -> int:
    """Return the index of a name or of a number from 1."""
    if isinstance(wanted, str) and wanted in names:
        return list(names).index(wanted)
    if isinstance(wanted, int) and 1 <= wanted <= len(names):
        return wanted - 1
    known = ", ".join(repr(name) for name in names if name)
    raise KeyError(f"no {what} {wanted!r}: there are {known or len(names)}")


def _check(name: str, value: object, known: Any) -> None:
    if value not in known.__args__:
        raise ValueError(f"`{name}` must be one of {', '.join(known.__args__)}, got {value!r}")


def _decoded(text: str) -> Values:
    """Return a list of a page, written as decimal digits, as even spacing, or as bytes of single
    precision."""
    kind, rest = text.split(" ", 1)
    if kind == "t":
        return np.array(rest.split(), dtype=np.float64)
    if kind == "e":
        first, last, count = rest.split()
        return np.linspace(float(first), float(last), int(count))
    scale, coded = rest.split()
    width = _BYTES[kind]
    known = np.frombuffer(base64.b64decode(coded), dtype=np.uint8).reshape(-1, width)
    single = np.zeros((len(known), 4), dtype=np.uint8)
    single[:, 4 - width :] = known
    return float(scale) * single.view("<f4")[:, 0].astype(np.float64)


def _chart(name: str, caption: str, data: dict[str, Any]) -> Chart:
    lists = [_decoded(text) for text in data["a"]]
    for values in lists:
        values.flags.writeable = False
    views = data["v"]
    members = tuple(
        _Member(
            panels=tuple(_panel(panel, lists) for panel in view["p"]),
            parts=tuple(panel.get("q", "") for panel in view["p"]),
            columns=max(1, view["c"]),
            shares_x=view["s"],
        )
        for view in views
    )
    return Chart(name, caption, tuple(view["n"] for view in views), members)


def _panel(data: dict[str, Any], lists: Sequence[Values]) -> Panel:
    references = tuple(
        Reference(one.get("n", ""), one["v"], one["h"], one["o"], tuple(one.get("d", ())))
        for one in data.get("f", ())
    )
    curves = tuple(_curve(one, lists) for one in data["c"])
    return Panel(data["t"], _axis(data["x"]), _axis(data["y"]), curves, references)


def _axis(data: dict[str, Any]) -> Axis:
    low, high = data["r"]
    return Axis(data["l"], data["u"], data["g"], (low, high), data.get("s"))


def _curve(data: dict[str, Any], lists: Sequence[Values]) -> Curve:
    def values(key: str) -> Values | None:
        return lists[data[key]] if data.get(key) is not None else None

    return Curve(
        name=data.get("n", ""),
        kind=_KINDS[data["k"]],
        x=lists[data["x"]],
        y=lists[data["y"]],
        upper=values("u"),
        phase_deg=values("p"),
        std_error=values("e"),
        color=data["o"],
        width=data["w"],
        dash=tuple(data.get("d", ())),
        marker=data.get("m"),
    )


def _shapes(name: str, caption: str, data: dict[str, Any]) -> ShapeFigure:
    parts = [np.array(mode["s"], dtype=np.float64).reshape(-1, 3, 2) for mode in data["modes"]]
    return ShapeFigure(
        name=name,
        caption=caption,
        members=tuple(mode["n"] for mode in data["modes"]),
        points=tuple(data["names"]),
        positions=np.array(data["points"], dtype=np.float64),
        lines=tuple((first, second) for first, second in data["lines"]),
        displacements=tuple(part[..., 0] + 1j * part[..., 1] for part in parts),
        _view=(data["turn"], data["tilt"]),
        _colors=tuple(data["colors"]),
    )


class _View:
    """Responses per unit force in another quantity, scale or form, as the script of a page shows them."""

    def __init__(
        self, drawn: _Member, show: Show, quantity: Quantity | None, scale: Scale | None, phase: Phase
    ) -> None:
        self._show, self._phase = show, phase
        magnitude = next((p for p, part in zip(drawn.panels, drawn.parts, strict=True) if part == "m"), None)
        if magnitude is None:
            if show != "bode" or quantity is not None or scale is not None:
                raise ValueError("`show`, `quantity` and `scale` are for responses per unit force, and this figure has none")
            return
        self._drawn_scale: Scale = "decibel" if magnitude.y.is_decibel else "log"
        self._scale = scale or self._drawn_scale
        _check("scale", self._scale, Scale)
        names = [name.lower() for name, _ in _ORDERS]
        label = magnitude.y.label.lower()
        self._turn = 0
        self._quantity = (magnitude.y.label, magnitude.y.unit.removeprefix("dB re 1 "))
        if quantity is not None:
            _check("quantity", quantity, Quantity)
            if label not in names:
                raise ValueError(f"the {label} of this figure cannot be converted into {quantity}")
            self._turn = names.index(quantity) - names.index(label)
            self._quantity = _ORDERS[names.index(quantity)]

    def of(self, panel: Panel) -> list[Panel]:
        """Return the panels of a magnitude with phases."""
        curves = [self._converted(curve, panel.x.unit) for curve in panel.curves]
        if self._show == "bode":
            return [self._magnitude(panel, curves), self._phases(panel, curves)]
        unit = self._quantity[1]
        real, imaginary = (
            tuple(replace(curve, y=part(curve), std_error=None, phase_deg=None) for curve in curves)
            for part in (_real, _imaginary)
        )
        axes = Axis("Real part", unit), Axis("Imaginary part", unit)
        if self._show == "complex":
            return [
                replace(panel, y=axis, curves=part, title=title)
                for axis, part, title in zip(axes, (real, imaginary), (panel.title, ""), strict=True)
            ]
        over = tuple(replace(i, x=r.y) for r, i in zip(real, imaginary, strict=True))
        return [Panel(panel.title, axes[0], axes[1], over, is_equal=True)]

    def _converted(self, curve: Curve, unit: str) -> Curve:
        """Return the curve in the requested quantity, as a magnitude in its unit."""
        omega = curve.x if unit == "rad/s" else 2 * np.pi * curve.x
        gain = omega**self._turn if self._turn else np.ones_like(omega)
        magnitude, error = curve.y, curve.std_error
        if self._drawn_scale == "decibel":
            magnitude = 10 ** (curve.y / 20)
            error = None if error is None else error * magnitude / NEPER
        error = None if error is None else error * gain
        degrees = np.asarray(curve.phase_deg) + 90.0 * self._turn
        return replace(curve, y=magnitude * gain, std_error=error, phase_deg=degrees)

    def _magnitude(self, panel: Panel, curves: list[Curve]) -> Panel:
        name, unit = self._quantity
        is_drawn = self._turn == 0 and self._scale == self._drawn_scale
        limits = panel.y.range if is_drawn else None
        if self._scale == "decibel":
            curves = [replace(one, y=20 * np.log10(one.y), std_error=_decibels(one)) for one in curves]
            unit = f"dB re 1 {unit}"
        curves = [replace(one, phase_deg=None) for one in curves]
        return replace(panel, y=Axis(name, unit, self._scale == "log", limits), curves=tuple(curves))

    def _phases(self, panel: Panel, curves: list[Curve]) -> Panel:
        limits = (-190.0, 190.0) if self._phase == "wrapped" else None
        axis = Axis("Phase", "°", False, limits, 45.0)
        if self._phase == "wrapped":
            turned = [replace(one, y=_near(_degrees(one), 0.0), is_wrapped=True) for one in curves]
        else:
            turned = [replace(one, y=np.unwrap(_degrees(one), period=360.0)) for one in curves]
            line = next((one for one in turned if one.kind == "line"), None)
            if line is not None:
                turned = [one if one.kind == "line" else _beside(one, line) for one in turned]
        turned = [replace(one, std_error=None, phase_deg=None) for one in turned]
        return replace(panel, title="", y=axis, curves=tuple(turned))


def _decibels(curve: Curve) -> Values | None:
    """Return the standard errors of a magnitude in dB."""
    return None if curve.std_error is None else NEPER * curve.std_error / curve.y


def _degrees(curve: Curve) -> Values:
    return np.asarray(curve.phase_deg, dtype=np.float64)


def _real(curve: Curve) -> Values:
    values: Values = curve.y * np.cos(np.radians(_degrees(curve)))
    return values


def _imaginary(curve: Curve) -> Values:
    values: Values = curve.y * np.sin(np.radians(_degrees(curve)))
    return values


def _near(angle: Values, other: Values | float) -> Values:
    """Return angles on the branch nearest to other angles, in degrees."""
    turned: Values = angle - 360.0 * np.floor((angle - other) / 360.0 + 0.5)
    return turned


def _beside(points: Curve, line: Curve) -> Curve:
    return replace(points, y=_near(points.y, np.interp(points.x, line.x, line.y)))

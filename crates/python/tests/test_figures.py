"""Figures of the pages drawn with Matplotlib: all of them, with the numbers of the results."""

from __future__ import annotations

import html
import json
import pickle
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mechid
from mechid import fleet, plotting

from .conftest import ROOT

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("agg")
from matplotlib import pyplot  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402

FILE = "examples/machine.csv"
COLUMNS: dict[str, Any] = {"force": "force", "displacement": "displacement"}
HITS: dict[str, Any] = {"force": "force", "acceleration": ["a1", "a2"], "hits": True, "band_hz": (2, 100)}
RIG: dict[str, Any] = {
    "force": ["fx", "fy"], "acceleration": ["ax", "ay"], "displacement": ["dx", "dy"], "period": 256,
    "stator_mass": 20.0, "rotation_hz": 50.0,
}  # fmt: skip
ELEMENTS: dict[str, Any] = {
    "dofs": ["displacement"],
    "elements": [
        {"name": "m", "at": "displacement", "m": {"start": 10.0, "min": 0}},
        {"name": "foot", "at": "displacement", "k": {"start": 1e5, "min": 0}, "c": {"start": 50}},
    ],
    "sensors": [{"at": "displacement", "quantity": "displacement"}],
    "inputs": [{"kind": "force", "name": "force", "at": "displacement"}],
}
CHAIN = mechid.Machine(np.diag([2.0, 3.0]), [[6.0, -2.0], [-2.0, 5.0]], [[9000.0, -4000.0], [-4000.0, 6000.0]])
# The page has single precision.
SINGLE = 1e-6


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    pyplot.close("all")


def hardening(folder: Path) -> mechid.Decayed:
    """A mass on a spring that hardens, released at 2 mm."""
    m, c, k, cube, h = 1.0, 1.2, (2 * np.pi * 10) ** 2, 4e8, 1 / 256 / 16
    state, record = np.array([2e-3, 0.0]), []

    def rate(z: Any) -> Any:
        return np.array([z[1], -(c * z[1] + k * z[0] + cube * z[0] ** 3) / m])

    for step in range(2048 * 16):
        if step % 16 == 0:
            record.append(state[0])
        a = rate(state)
        b = rate(state + h / 2 * a)
        d = rate(state + h / 2 * b)
        state = state + h / 6 * (a + 2 * b + 2 * d + rate(state + h * d))
    noise = np.random.default_rng(1).normal(0, 1e-6, len(record))
    return mechid.decay(displacement=np.array(record) + noise, fs=256)


def study(folder: Path) -> fleet.Trends:
    """The masses of three records."""
    described: Any = {
        "system": {"mass": 25, "damping": 188.5, "stiffness": 142122},
        "sampling": {"samples": 256, "rate_hz": 128},
        "excitation": {"lines": "4:60", "amplitude": 2},
        "periods": 2,
        "noise": {"displacement": {"fraction_of_rms": 0.01}, "seed": 1},
    }
    analysis = {
        "channels": {"force": ["force"], "displacement": ["displacement"]}, "window": {"period": 256},
        "identify": {"method": "maximum-likelihood"}, "reading": {"record_column": "run"},
    }  # fmt: skip
    fleet.simulate(described, folder / "runs.parquet", 3)
    fleet.run(folder / "runs.parquet", analysis, folder / "results")
    return fleet.trends(folder / "results")


def campaign() -> dict[str, Any]:
    point = {"tests": ["examples/bearing-rig.csv"]}
    return {
        "channels": {name: RIG[name] for name in ("force", "acceleration", "displacement")},
        "window": {"period": 256}, "settings": {"stator_mass": 20.0}, "baseline": ["examples/bearing-dry.csv"],
        "points": [point | {"rotation_hz": 50.0}, point | {"rotation_hz": 25.0}],
    }  # fmt: skip


def table_of_chain() -> mechid.ResponseTable:
    frequency = np.linspace(2.0, 20.0, 60)
    noise = np.random.default_rng(1).normal(0, 1e-7, (2, 60, 2, 2))
    response = CHAIN.receptance(frequency) + noise[0] + 1j * noise[1]
    return mechid.ResponseTable(
        frequency, response, quantity="displacement", std_error=np.full(response.shape, 1e-7)
    )


Pages = Mapping[str, tuple[Any, str]]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Pages:
    """A result of each kind with the page that its figures come from."""
    with pytest.MonkeyPatch.context() as there:
        there.chdir(ROOT)
        pytest.importorskip("pyarrow")
        other = mechid.Measurement.open(FILE, **COLUMNS, period=256)
        found = mechid.identify(FILE, **COLUMNS, period=256, validate=other)
        hammer = mechid.identify("examples/hammer-1.csv", **{**HITS, "force": ["force", "0"]})
        cubic = mechid.identify(FILE, **COLUMNS, period=256, nonlinear="k3: x1^3")
        both = mechid.frf("examples/hammer-1.csv", **{**HITS, "force": ["force", "0"]})
        made = {
            "identified": found,
            "identified in time": mechid.identify(FILE, **COLUMNS, velocity="velocity", domain="time"),
            "hammer": hammer,
            "nonlinear": cubic,
            "frequency responses": both,
            "tables": mechid.identify_responses(table_of_chain()),
            "inspected": mechid.inspect(FILE, curves=True),
            "decay": mechid.decay("examples/decay.csv", acceleration=["a1", "a2", "a3"]),
            "hardening decay": hardening(tmp_path_factory.mktemp("decay")),
            "modes": mechid.modes("examples/hammer-1.csv", **HITS),
            "bearing": mechid.bearing("examples/bearing-rig.csv", baseline="examples/bearing-dry.csv", **RIG),
            "bearing over speed": mechid.bearing_campaign(campaign()),
            "elements": mechid.identify_elements(FILE, machine=ELEMENTS, period=256),
            "machine": CHAIN,
            "nonlinear machine": cubic.machine(),
            "force": mechid.reconstruct(found, FILE, displacement="displacement", period=256),
            "sweep": mechid.sweep("examples/machine.json", npi=[2, 4]),
            "trends": study(tmp_path_factory.mktemp("study")),
        }
        pages = {
            name: (result, result.page if isinstance(result, fleet.Trends) else result._page)
            for name, result in made.items()
        }
        pages["with the force"] = (None, found.report(reconstruct_force=True))
        return pages


def figures(result: Any, page: str) -> Mapping[str, Any]:
    return plotting.figures(page) if result is None else result.figures


def points(axes: Axes) -> list[np.ndarray]:
    """Ordinates of all drawn points."""
    drawn = [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines]
    for collection in axes.collections:
        drawn.extend(path.vertices[:, 1] for path in collection.get_paths())
    return drawn


def has(axes: Axes, values: np.ndarray) -> bool:
    """Whether one artist, or all stems together, have these ordinates."""
    drawn = points(axes)
    stems = [path.vertices[1, 1] for c in axes.collections for path in c.get_paths() if len(path.vertices) == 2]
    return any(
        np.isin(values, one[np.isfinite(one)]).all() for one in [*drawn, np.array(stems, dtype=float)] if len(one)
    )


def test_every_figure_of_every_page_is_drawn(results: Pages) -> None:
    """Each curve is in the axes, with the quantity and the unit of the page."""
    for kind, (result, page) in results.items():
        drawn = figures(result, page)
        assert len(drawn) == page.count("<figure ") > 0, kind
        for name, figure in drawn.items():
            for member in figure.members[:4]:
                if not isinstance(figure, plotting.Chart):
                    (axes,) = figure.plot(*([member] if member else []))
                    assert axes.lines or axes.images, (kind, name)
                    continue
                panels = figure.panels(member)
                for panel, axes in zip(panels, figure.plot(member), strict=True):
                    assert axes.get_ylabel() == panel.y.caption, (kind, name)
                    for curve in panel.curves:
                        assert has(axes, curve.y), (kind, name, member, curve.name)
                pyplot.close("all")


def test_no_figure_of_the_pages_is_forgotten(results: Pages) -> None:
    """Reference: the identifiers in the sources of the pages."""
    known = {re.sub(r"-\d+$", "", name) for result, page in results.values() for name in plotting.figures(page)}
    sources = "".join(path.read_text("utf-8") for path in (ROOT / "crates/report/src/page").glob("*.rs"))
    named = r'(?:\bdrawn\w*\(\s*|part\.id\(|over_time\(|\bid: |format!\()"([a-z-]+)(?:-\{number\})?"(?:\.into\(\)|\)|,)'
    stated = set(re.findall(named, sources))
    assert {"receptance", "fit", "validation", "restoring-force", "backbone", "sensors", "shapes"} <= stated
    assert stated <= known, stated - known


def test_the_curves_are_the_numbers_of_the_result(results: Pages) -> None:
    found: mechid.Identified = results["identified"][0]
    magnitude, phase = found.figures["receptance"].panels()
    measured = next(curve for curve in magnitude.curves if curve.name == "measured")
    h = found.frf.measured[:, 0, 0]
    np.testing.assert_allclose(measured.x, found.frf.frequency_hz, rtol=SINGLE)
    np.testing.assert_allclose(measured.y, np.abs(h), rtol=SINGLE)
    degrees = next(curve.y for curve in phase.curves if curve.name == "measured")
    np.testing.assert_allclose(np.exp(1j * np.radians(degrees)), np.exp(1j * np.angle(h)), atol=2e-4)
    fit, residual = found.figures["fit"].panels()
    of_record = {curve.name: curve.y for curve in fit.curves}
    x, model = (values[:256, 0] for values in found.compared["displacement"])
    np.testing.assert_allclose(of_record["measured"], x, rtol=SINGLE)
    np.testing.assert_allclose(of_record["modelled"], model, rtol=SINGLE)
    np.testing.assert_allclose(residual.curves[0].y, x - model, atol=SINGLE * np.abs(x).max())
    swept: mechid.Sweep = results["sweep"][0]
    np.testing.assert_allclose(swept.figures["figure"].panels()[0].curves[0].y, 100 * swept.error)
    trends: fleet.Trends = results["trends"][0]
    mass = trends.fields["series"][0]
    (axes,) = trends.plot(mass["name"])
    assert axes.get_ylabel() == "m (kg)" and has(axes, np.array([point["value"] for point in mass["points"]]))


def test_the_numbers_of_modes_forces_and_bearings_are_drawn(results: Pages) -> None:
    modes: mechid.Modes = results["modes"][0]
    shapes = modes.figures["shapes"]
    assert isinstance(shapes, plotting.ShapeFigure)
    for mode, drawn in zip(modes.modes, shapes.displacements, strict=True):
        np.testing.assert_allclose(drawn[:, 2], mode.shape, atol=1e-4)
    squares = modes.figures["assurance"]
    assert isinstance(squares, plotting.MatrixFigure)
    np.testing.assert_allclose(squares.values, modes.mac, atol=5e-4)
    force: mechid.Reconstructed = results["force"][0]
    over_time = force.figures["figure"].panels()[0]
    line = next(curve for curve in over_time.curves if curve.kind == "line")
    np.testing.assert_allclose(line.y, force.force[:, 0], rtol=SINGLE)
    speeds: mechid.BearingTable = results["bearing over speed"][0]
    assert speeds.rotation_hz.tolist() == [25.0, 50.0] and np.isnan(speeds.load).all() and "2 speeds" in repr(speeds)
    stiffness = speeds.figures["figure"].panels()[0]
    direct = next(curve for curve in stiffness.curves if curve.name == "kxx")
    np.testing.assert_allclose(1e6 * direct.y, [row["kxx"].value for row in speeds.rows])
    assert stiffness.y.caption == "Stiffness (MN/m)" and direct.x.tolist() == [25.0, 50.0]
    decay: mechid.Decayed = results["hardening decay"][0]
    told = decay.to_dict()["backbone"]["points"]
    frequency = decay.figures["backbone"].panels()[0]
    estimate = next(curve for curve in frequency.curves if curve.kind == "marked line")
    np.testing.assert_allclose(estimate.y, [point["frequency_hz"]["value"] for point in told], rtol=SINGLE)
    assert frequency.y.caption == "Frequency (Hz)" and frequency.x.caption == "Amplitude (m)"


def test_responses_are_shown_in_every_quantity_and_form(results: Pages) -> None:
    """Reference: powers of iω, and real and imaginary part of the complex numbers."""
    table: mechid.FrequencyResponses = results["frequency responses"][0]
    chart = table.figures["figure"]
    assert isinstance(chart, plotting.Chart) and len(chart.members) == len(table.pairs) == 2
    omega, h = 2j * np.pi * table.frequency_hz, table.response(2, 1)
    kept = np.abs(h) > 0
    for order, (quantity, unit) in enumerate({"accelerance": "m/(s²·N)", "mobility": "m/(s·N)", "receptance": "m/N"}.items()):
        truth = (h / omega**order)[kept] if omega[0] != 0 else h[kept]
        magnitude, phase, coherence = chart.panels(2, quantity=quantity)
        assert magnitude.y.caption == f"{quantity.capitalize()} ({unit})" and phase.y.caption == "Phase (°)"
        np.testing.assert_allclose(magnitude.curves[0].y, np.abs(truth), rtol=SINGLE)
        np.testing.assert_allclose(
            np.exp(1j * np.radians(phase.curves[0].y)), truth / np.abs(truth), atol=2e-4
        )
        real, imaginary, _ = chart.panels(2, quantity=quantity, show="complex")
        both = real.curves[0].y + 1j * imaginary.curves[0].y
        np.testing.assert_allclose(both, truth, atol=2e-4 * np.abs(truth).max())
        nyquist, _ = chart.panels(2, quantity=quantity, show="nyquist")
        np.testing.assert_array_equal(nyquist.curves[0].x, real.curves[0].y)
        np.testing.assert_array_equal(nyquist.curves[0].y, imaginary.curves[0].y)
    np.testing.assert_allclose(coherence.curves[0].y, table.coherence(2), rtol=SINGLE)
    decibel = chart.panels(2, scale="decibel")[0]
    np.testing.assert_allclose(10 ** (decibel.curves[0].y / 20), np.abs(h)[kept], rtol=SINGLE)
    assert decibel.y.unit == "dB re 1 m/(s²·N)"
    continuous = chart.panels(2, phase="continuous")[1].curves[0].y
    assert np.abs(np.diff(continuous)).max() <= 180
    error = chart.panels(2)[0].curves[0].std_error
    assert error is not None
    np.testing.assert_allclose(error, table.std_error(2, 1)[kept], rtol=0.01)


def test_axes_and_panels_are_those_that_were_asked_for(results: Pages) -> None:
    found: mechid.Identified = results["identified"][0]
    _, grid = pyplot.subplots(3, 1)
    assert found.plot("receptance", panel="Phase", ax=grid[2]) == [grid[2]] and grid[2].lines
    assert found.plot(ax=grid[0]) == [grid[0]] and grid[0].get_ylabel() == "Receptance (m/N)"
    assert found.plot("fit", ax=grid[:2]) == [grid[0], grid[1]] and not len(pyplot.get_fignums()) > 1
    with pytest.raises(ValueError, match="2 panels, got 3 axes"):
        found.plot("fit", ax=grid)
    # Curves that are already in the axes remain visible.
    ax = pyplot.subplots()[1]
    ax.plot([1.0, 1000.0], [1e-9, 1.0])
    found.plot(ax=ax)
    assert ax.get_xlim()[1] >= 1000.0 and ax.get_ylim()[0] <= 1e-9
    for wrong, message in [
        ({"name": "no"}, "there are force, motion"), ({"member": "no"}, "no member 'no'"),
        ({"panel": "no"}, "'Receptance', 'Phase'"), ({"panel": 0}, "no panel 0"),
    ]:  # fmt: skip
        with pytest.raises(KeyError, match=message):
            found.plot(**wrong)
    for wrong in ({"show": "x"}, {"scale": "x"}, {"phase": "x"}, {"quantity": "x"}):
        with pytest.raises(ValueError, match="must be one of"):
            found.plot(**wrong)
    with pytest.raises(ValueError, match="this figure has none"):
        found.plot("fit", quantity="mobility")


def test_curves_that_were_not_gathered_are_asked_for() -> None:
    with pytest.raises(mechid.MechidError, match="`curves=True`"):
        mechid.inspect(FILE).plot()


def test_functions_draw_the_quantity_that_was_measured(results: Pages) -> None:
    hammer: mechid.Identified = results["hammer"][0]
    for motion in (1, 2):
        ax = plotting.receptance(hammer, motion, 1)
        assert ax.get_ylabel() == "Accelerance (m/(s²·N))"
        ax = plotting.receptance(hammer, motion, 1, quantity="receptance")
        assert ax.get_ylabel() == "Receptance (m/N)" and ax.get_title().startswith(f"a{motion}")
    with pytest.raises(KeyError):
        plotting.receptance(hammer, 1, 2)
    table: mechid.FrequencyResponses = results["frequency responses"][0]
    assert "Phase (°)" == plotting.frf(table, 2, 1, panel="Phase", phase="continuous").get_ylabel()
    assert plotting.coherence(table, 2).get_ylabel() == "Coherence"
    for wrong in ((3, 1), (1, 3)):
        with pytest.raises(KeyError):
            plotting.frf(table, *wrong)
    with pytest.raises(KeyError):
        plotting.coherence(table, 3)
    with pytest.raises(KeyError):
        plotting.force(results["force"][0], 2)


def test_pages_of_the_program_are_drawn_too(program: Callable[..., str], tmp_path: Path) -> None:
    page = tmp_path / "rig.html"
    program("frf", FILE, "--force", "force", "--displacement", "displacement", "--period", 256, "--plot-magnitude", "db", "--plot", page)
    table = mechid.frf(FILE, **COLUMNS, period=256)
    magnitude = plotting.figures(page)["figure"].panels(scale="log", quantity="mobility")[0]
    truth = np.abs(2 * np.pi * table.frequency_hz * table.response())
    np.testing.assert_allclose(magnitude.curves[0].y, truth[truth > 0], rtol=SINGLE)


def test_reports_have_a_geometry_and_further_lines(tmp_path: Path) -> None:
    modes = mechid.modes("examples/hammer-1.csv", **HITS)
    frame = tmp_path / "frame.csv"
    frame.write_text("a1,0,0,0\na2,0,0,2\nline,a1,a2\n", encoding="utf-8")
    page = modes.report(tmp_path / "modes.html", title="<rig>", about={"Operator": "M. & C."}, geometry=frame)
    assert (tmp_path / "modes.html").read_text(encoding="utf-8") == page
    assert "&lt;rig&gt;" in page and "M. &amp; C." in page
    shapes = plotting.figures(page)["shapes"]
    assert isinstance(shapes, plotting.ShapeFigure)
    assert shapes.points == ("a1", "a2") and shapes.lines == ((0, 1),)
    assert shapes.positions.tolist() == [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]]
    rest, turned = (shapes.plot(1, phase_deg=at)[0].lines[-1].get_ydata() for at in (90.0, 0.0))
    assert not np.allclose(rest, turned, atol=0.01)
    modes.write_shapes(tmp_path / "modes.unv", geometry=frame)
    assert len(re.findall(r"^ +55$", (tmp_path / "modes.unv").read_text(encoding="utf-8"), re.MULTILINE)) == 2
    frame.write_text("other,0,0,0\n", encoding="utf-8")
    for call in (lambda: modes.report(geometry=frame), lambda: modes.write_shapes("x", geometry=frame)):
        with pytest.raises(mechid.MechidError, match="`geometry`, if given, must have a point"):
            call()
    found = mechid.identify(FILE, **COLUMNS, period=256)
    assert "rig 3" in found.report(about={"Place": "rig 3"})
    with pytest.raises(mechid.MechidError, match="two channels"):
        found.write_shapes(tmp_path / "x.unv")


def test_shapes_are_those_that_the_program_writes(program: Callable[..., str], tmp_path: Path) -> None:
    table = tmp_path / "program.unv"
    program("modes", "examples/decay.csv", "--acceleration", "a1,a2,a3", "--shapes", table)
    mechid.decay("examples/decay.csv", acceleration=["a1", "a2", "a3"]).write_shapes(tmp_path / "python.unv")
    assert (tmp_path / "python.unv").read_bytes() == table.read_bytes()


def test_two_sets_of_modes_are_compared_in_squares() -> None:
    modes = mechid.modes("examples/hammer-1.csv", **HITS)
    compared = mechid.compare_modes(modes, modes)
    (axes,) = compared.plot()
    assert axes.images and axes.get_xlabel() == "Mode"
    np.testing.assert_array_equal(axes.images[0].get_array(), compared.mac)
    squares = re.search(r'<figure id="figure-assurance".*?</figure>', modes.report(), re.DOTALL)
    assert squares is not None
    alone = plotting.figures("<!DOCTYPE html>" + squares.group())["assurance"]
    assert isinstance(alone, plotting.MatrixFigure)
    np.testing.assert_allclose(alone.values, modes.mac, atol=0.02)


def test_a_campaign_is_that_of_the_program(program: Callable[..., str], tmp_path: Path) -> None:
    plan = tmp_path / "campaign.json"
    plan.write_text(json.dumps(campaign()), encoding="utf-8")
    told = program("bearing", plan, "--campaign", "--json")
    for given in (plan, campaign()):
        assert mechid.bearing_campaign(given).to_json() + "\n" == told
    with pytest.raises(mechid.MechidError, match="unknown field"):
        mechid.bearing_campaign({"speeds": []})


def test_a_notebook_shows_pages_in_frames_of_their_own(results: Pages) -> None:
    """Style and script of a page do not affect the notebook."""
    for kind, (result, _) in results.items():
        if result is None:
            continue
        shown = result._repr_html_()
        frame = re.fullmatch(r'<div><iframe sandbox="allow-scripts" srcdoc="([^"]*)"[^>]*></iframe><pre>(.*)</pre></div>', shown, re.DOTALL)
        assert frame is not None and html.unescape(frame.group(1)).startswith("<!DOCTYPE"), kind
        assert html.unescape(frame.group(2)) == str(result), kind
        assert "<script" not in shown and "<style" not in shown, kind


def test_a_pickled_result_says_why_it_has_no_figures(results: Pages) -> None:
    found = pickle.loads(pickle.dumps(results["identified"][0]))
    with pytest.raises(mechid.MechidError, match="pickled"):
        found.plot()

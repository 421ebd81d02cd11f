"""Usual names of columns, time in data frames, and results that are pickled."""

import copy
import pickle
import re

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import mechid

FS = 100.0
T = np.arange(200) / FS
W = 2 * np.pi * 5
FORCE = np.cos(W * T) + np.cos(3 * W * T)
# The machine has 2 kg, 30 N·s/m and 5000 N/m.
ACC = sum((-(k * W) ** 2 / (5000 - 2 * (k * W) ** 2 + 30j * k * W) * np.exp(1j * k * W * T)).real for k in (1, 3))
PERIOD = {"period": 20}


def mass(table, **how):
    found = mechid.identify(table, **{"force": "force", "acceleration": "acc", **PERIOD, **how})
    return found.parameters["m"].value


def test_columns_are_found_with_their_units_or_without():
    frame = pd.DataFrame({"Force [kN]": FORCE / 1e3, "acc [g]": ACC / 9.80665})
    assert mass(frame, fs=FS) == pytest.approx(2.0)
    assert mass(frame, fs=FS, acceleration="acc [g]") == pytest.approx(2.0)
    with pytest.raises(mechid.MechidError, match="no column") as caught:
        mass(frame, fs=FS, acceleration="vel")
    assert caught.value.code == "analysis.no-column"


def test_units_of_attributes_and_of_the_call_are_used():
    frame = pd.DataFrame({"force": FORCE, "acc": ACC / 9.80665})
    frame.attrs = {"units": {"acc": "g"}, "fs": FS}
    assert mass(frame) == pytest.approx(2.0)
    dataset = xr.Dataset(
        {"force": ("time", FORCE), "acc": ("time", ACC / 9.80665, {"units": "g"})}, {"time": T}
    )
    assert mass(dataset) == pytest.approx(2.0)
    bare = {"force": FORCE * 11.2, "acc": ACC / 9.80665}
    assert mass(bare, fs=FS, unit={"acc": "g"}, scale={"force": 1 / 11.2}) == pytest.approx(2.0)
    doubtful = mechid.identify({"force": FORCE, "acc [V]": ACC}, force="force", acceleration="acc", fs=FS, **PERIOD)
    assert [finding.subject for finding in doubtful.warnings if finding.subject == "unit"] == ["unit"]


@pytest.mark.parametrize(
    "frame",
    [
        pd.DataFrame({"time": T, "force": FORCE, "acc": ACC}),
        pd.DataFrame({"time_ms": 1e3 * T, "force": FORCE, "acc": ACC}),
        pd.DataFrame({"force": FORCE, "acc": ACC}, index=pd.Index(T, name="time")),
        pd.DataFrame({"force": FORCE, "acc": ACC}, index=T),
        pd.DataFrame({"force": FORCE, "acc": ACC}, index=pd.to_datetime("2023-03-14") + pd.to_timedelta(T, "s")),
        pd.DataFrame({"force": FORCE, "acc": ACC}, index=pd.to_timedelta(T, "s")),
        pd.DataFrame({"time": pd.to_datetime("2023-03-14") + pd.to_timedelta(T, "s"), "force": FORCE, "acc": ACC}),
    ],
)
def test_the_time_of_a_table_gives_its_rate(frame):
    assert mechid.Measurement.from_table(frame, force="force", acceleration="acc").fs == pytest.approx(FS)


@pytest.mark.parametrize(
    ("values", "name"),
    [
        (1e3 * T, "time [ms]"),
        (1e3 * T, "t_ms"),
        (T / 60, "Zeit (min)"),
        (T, "elapsed [s]"),
        (1e3 * T, "since start (ms)"),
        (T + 7.5, None),
        (np.arange(200) / FS, "TIME"),
    ],
)
def test_an_index_with_the_name_or_a_unit_of_time_is_time(values, name):
    frame = pd.DataFrame({"force": FORCE, "acc": ACC}, index=pd.Index(values, name=name))
    assert mechid.Measurement.from_table(frame, force="force", acceleration="acc").fs == pytest.approx(FS)


@pytest.mark.parametrize("name", ["Distance [m]", "angle [deg]", "Frequency [Hz]", "depth", "sample", "time [mm]", 7])
def test_another_index_is_not_time(name):
    frame = pd.DataFrame({"force": FORCE, "acc": ACC}, index=pd.Index(T, name=name))
    channels = {"force": "force", "acceleration": "acc"}
    with pytest.raises(TypeError, match=re.escape(f"the index '{name}' is not called time") + ".*`fs`.*`time`"):
        mechid.Measurement.from_table(frame, **channels)
    assert mechid.Measurement.from_table(frame, **channels, fs=50.0).fs == 50.0


def test_a_call_may_say_that_the_index_is_time():
    frame = pd.DataFrame({"force": FORCE, "acc": ACC}, index=pd.Index(1e3 * T, name="depth"))
    channels = {"force": "force", "acceleration": "acc"}
    assert mechid.Measurement.from_table(frame, **channels, time="depth").fs == pytest.approx(FS / 1e3)
    assert mechid.Measurement.from_table(frame, **channels, unit={"depth": "ms"}).fs == pytest.approx(FS)
    frame.attrs["units"] = {"depth": "ms"}
    assert mechid.Measurement.from_table(frame, **channels).fs == pytest.approx(FS)
    with pytest.raises(mechid.MechidError, match="no column"):
        mechid.Measurement.from_table(frame, **channels, time="dept")


@pytest.mark.parametrize("first", [0, 1, 50])
def test_positions_of_samples_are_not_time(first):
    frame = pd.DataFrame({"force": FORCE, "acc": ACC}, index=np.arange(200.0) + first)
    with pytest.raises(TypeError, match="a table needs its sampling rate"):
        mechid.Measurement.from_table(frame, force="force", acceleration="acc")


def test_a_table_without_time_is_asked_for_its_rate():
    with pytest.raises(TypeError, match="sampling rate"):
        mechid.Measurement.from_table(pd.DataFrame({"force": FORCE, "acc": ACC}), force="force", acceleration="acc")


def test_channels_of_sep_5_may_have_instants():
    channels = [
        {"name": "force", "data": FORCE, "time": T, "unit_str": "N"},
        {"name": "acc", "data": ACC / 9.80665, "time": T, "unit_str": "g"},
    ]
    assert mass(channels) == pytest.approx(2.0)


def test_a_misspelt_keyword_is_named():
    with pytest.raises(TypeError, match="unexpected keyword argument 'acceleratoin'; did you mean `acceleration`"):
        mechid.identify({"force": FORCE}, force="force", acceleratoin="acc", fs=FS)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda file: mechid.inspect(file, column="force"), "inspect() got .*'column'; did you mean `columns`"),
        (lambda file: mechid.inspect(file, sample_rate=1.0), "inspect() got .*'sample_rate'; did you mean `fs`"),
        (lambda file: mechid.inspect(file, units={}), r"inspect() got .*'units'$"),
        (lambda file: mechid.Measurement.open(file, forces="force"), "Measurement.open() got .*'forces'; did you mean `force`"),
        (lambda file: mechid.Measurement.open(file, force="force").window(periode=9), "Measurement.window() got .*`period`"),
        (lambda file: mechid.Measurement.from_arrays(FORCE, ACC, fs=FS, perid=20), "Measurement.from_arrays() got .*`period`"),
        (lambda file: mechid.Measurement.from_arrays(FORCE, disp=ACC, fs=FS), "Measurement.from_arrays() got .*`displacement`"),
        (lambda file: mechid.Measurement.from_table({}, acc="acc"), "Measurement.from_table() got .*`acceleration`"),
        (lambda file: mechid.simulate("examples/machine.json").measurement(starts=2), "Simulation.measurement() got .*`start`"),
    ],
)
def test_every_function_of_records_names_a_misspelt_keyword(call, said):
    with pytest.raises(TypeError, match=said.replace("()", r"\(\)")):
        call("examples/machine.csv")


def test_results_are_copied_and_pickled():
    frame = pd.DataFrame({"force": FORCE, "acc": ACC})
    record = mechid.Measurement.from_table(frame, force="force", acceleration="acc", fs=FS, **PERIOD)
    found = mechid.identify(record)
    assert copy.deepcopy(found) is found
    assert found.parameters["m"].value == pytest.approx(2.0)
    again = pickle.loads(pickle.dumps(found))
    assert str(again) == str(found)
    assert again.parameters["m"].value == found.parameters["m"].value
    np.testing.assert_array_equal(again.mass, found.mass)
    np.testing.assert_array_equal(again.covariance, found.covariance)
    with pytest.raises(mechid.MechidError, match="was pickled"):
        again.to_svg()
    np.testing.assert_allclose(pickle.loads(pickle.dumps(record)).force, record.force)
    assert len(repr(found)) < 200


def test_parameters_are_a_data_frame():
    found = mechid.identify({"force": FORCE, "acc": ACC}, force="force", acceleration="acc", fs=FS, **PERIOD)
    frame = found.to_frame()
    assert list(frame.index) == ["m", "c", "k"]
    assert frame.loc["k", "value"] == pytest.approx(5000.0)
    assert frame.loc["k", "unit"] == "N/m"


def test_a_response_table_states_its_quantity_or_is_asked():
    hz = np.arange(1.0, 40.0)
    s = 2j * np.pi * hz
    accelerance = s**2 / (2 * s**2 + 30 * s + 5000)
    stated = mechid.ResponseTable(hz, accelerance, quantity="acceleration")
    assert "acceleration" in repr(stated)
    assert mechid.identify_responses(stated).parameters["m"].value == pytest.approx(2.0)
    bare = mechid.ResponseTable(hz, accelerance)
    with pytest.raises(mechid.MechidError, match="what was measured"):
        mechid.identify_responses(bare)
    with pytest.raises(TypeError, match="`segments` needs its `count`"):
        mechid.ResponseTable(hz, accelerance, segments={"samples": 100, "fs": FS})


def test_dates_with_a_time_zone_are_instants():
    index = pd.Timestamp("2023-03-14", tz="Europe/Berlin") + pd.to_timedelta(T, "s")
    frame = pd.DataFrame({"force": FORCE, "acc": ACC}, index=index)
    assert mechid.Measurement.from_table(frame, force="force", acceleration="acc").fs == pytest.approx(FS)


DATES = pd.Timestamp("2024-03-31T01:59:59") + pd.to_timedelta(T, "s")
ISO = [date.isoformat(timespec="nanoseconds") for date in DATES]
# The clock is put forward one second after the beginning; the instants are equally spaced.
ZONED = [date.isoformat() for date in DATES.tz_localize("UTC").tz_convert("Europe/Berlin") - pd.Timedelta(3600, "s")]


@pytest.mark.parametrize(
    "table",
    [
        pd.DataFrame({"time": ISO, "force": FORCE, "acc": ACC}),
        pd.DataFrame({"time": np.array(ISO, dtype=object), "force": FORCE, "acc": ACC}),
        pd.DataFrame({"force": FORCE, "acc": ACC}, index=pd.Index(ISO, name="time")),
        {"time": ISO, "force": FORCE, "acc": ACC},
        {"time": [text.replace("T", " ").replace(".", ",") + "000Z" for text in ISO], "force": FORCE, "acc": ACC},
        {"time": ZONED, "force": FORCE, "acc": ACC},
    ],
)
def test_instants_may_be_text(table):
    assert mechid.Measurement.from_table(table, force="force", acceleration="acc").fs == pytest.approx(FS)


@pytest.mark.parametrize("wrong", ["14.03.2023 09:26", "0.01", "2024-02-30T00:00:00", None])
def test_text_that_is_no_instant_is_named(wrong):
    texts = np.array([*ISO[:2], wrong, *ISO[3:]], dtype=object)
    for table in ({"time": texts, "force": FORCE, "acc": ACC}, pd.DataFrame({"time": texts, "force": FORCE, "acc": ACC})):
        with pytest.raises(TypeError, match="`time` holds .* in row 3: .*2023-03-14T09:26:53.5"):
            mechid.Measurement.from_table(table, force="force", acceleration="acc")


def test_a_series_is_converted_from_the_unit_that_it_states():
    frame = pd.DataFrame({"Force [kN]": FORCE / 1e3, "acc [g]": ACC / 9.80665})
    found = mechid.identify(frame["Force [kN]"], acceleration=frame["acc [g]"], fs=FS, **PERIOD)
    assert found.parameters["m"].value == pytest.approx(2.0)
    array = xr.DataArray(ACC / 9.80665, dims="time", attrs={"units": "g"})
    found = mechid.identify(FORCE, acceleration=array, fs=FS, **PERIOD)
    assert found.parameters["m"].value == pytest.approx(2.0)
    with pytest.raises(mechid.MechidError, match="a unit of displacement"):
        mechid.identify(FORCE, acceleration=pd.Series(ACC, name="x [mm]"), fs=FS, **PERIOD)


def test_channels_of_sep_5_are_found_without_their_unit_and_take_another():
    channels = [
        {"name": "force [kN]", "data": FORCE / 1e3, "fs": FS},
        {"name": "acc", "data": ACC / 9.80665, "fs": FS, "unit_str": "m/s^2"},
    ]
    assert mass(channels, unit={"acc": "g"}) == pytest.approx(2.0)
    assert mass(channels, scale={"acc": 9.80665}) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("name", "unit"),
    [("F [N]", "kN"), ("F [kN]", "N"), ("F (mm)", "N"), ("F_lbf", "N"), ("F_kN", "lbf"), ("F/N", "kN")],
)
def test_a_name_and_attributes_with_different_units_are_refused(name, unit):
    said = re.escape(f"column {name!r} states one unit in its name and another, {unit!r}")
    frame = pd.DataFrame({name: FORCE, "acc": ACC})
    frame.attrs["units"] = {name: unit}
    how = {"force": name, "acceleration": "acc", "fs": FS}
    with pytest.raises(ValueError, match=said):
        mechid.Measurement.from_table(frame, **how)
    record = mechid.Measurement.from_table(frame, **how, unit={name: "kN"})
    np.testing.assert_allclose(record.force[:, 0], 1e3 * FORCE)
    array = xr.DataArray(FORCE, dims="time", name=name, attrs={"units": unit})
    for call in (
        lambda: mechid.Measurement.from_table(xr.Dataset({name: array, "acc": ("time", ACC)}), **how),
        lambda: mechid.Measurement.from_arrays(array, acceleration=ACC, fs=FS),
        lambda: mechid.Measurement.from_table(
            [{"name": name, "data": FORCE, "unit_str": unit, "fs": FS}, {"name": "acc", "data": ACC, "fs": FS}],
            force=name, acceleration="acc",
        ),
    ):
        with pytest.raises(ValueError, match=said):
            call()


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [
        ("acc", "g", 9.80665),
        ("acc [g]", "g", 9.80665),
        ("acc [m/s^2]", "m/s²", 1.0),
        ("acc [m/s^2]", "m s-2", 1.0),
        ("acc [ch 1]", "g", 9.80665),
        ("acc [V]", "g", 9.80665),
        ("a_g", "g", 9.80665),
        ("acc_mg", "mg", 9.80665e-3),
        ("acc (m/s², 100 mV/g)", "m/s^2", 1.0),
        ("acc [g]", "V", 9.80665),
    ],
)
def test_a_name_and_attributes_that_agree_are_read(name, unit, factor):
    frame = pd.DataFrame({"force": FORCE, name: ACC})
    frame.attrs["units"] = {name: unit}
    record = mechid.Measurement.from_table(frame, force="force", acceleration=[name], fs=FS)
    np.testing.assert_allclose(record.responses["acceleration"][:, 0], factor * ACC)


def test_the_units_of_time_are_compared_too():
    for name, unit in [("time [s]", "ms"), ("time_ms", "s")]:
        frame = pd.DataFrame({name: T, "force": FORCE, "acc": ACC})
        frame.attrs["units"] = {name: unit}
        with pytest.raises(ValueError, match="states one unit in its name"):
            mechid.Measurement.from_table(frame, force="force", acceleration="acc")
    for name, unit in [("time", "ms"), ("time [ms]", "ms"), ("time_ms", "ms")]:
        frame = pd.DataFrame({name: 1e3 * T, "force": FORCE, "acc": ACC})
        frame.attrs["units"] = {name: unit}
        assert mechid.Measurement.from_table(frame, force="force", acceleration="acc").fs == pytest.approx(FS)


def test_a_factor_of_the_time_is_used():
    frame = pd.DataFrame({"time": 1e3 * T, "force": FORCE, "acc": ACC})
    for table, name in [(frame, "time"), (frame.set_index("time"), "time"), (frame.set_index("time").rename_axis("n"), "n")]:
        record = mechid.Measurement.from_table(table, force="force", acceleration="acc", scale={name: 1e-3})
        assert record.fs == pytest.approx(FS)


def test_keywords_of_other_packages_are_named():
    for wrong, right in [("sample_rate", "fs"), ("disp", "displacement"), ("perod", "period")]:
        with pytest.raises(TypeError, match=f"'{wrong}'; did you mean `{right}`"):
            mechid.identify(FORCE, ACC, fs=FS, **{wrong: 1})


def test_machines_tables_and_modes_travel_too():
    found = mechid.identify({"force": FORCE, "acc": ACC}, force="force", acceleration="acc", fs=FS, **PERIOD)
    machine = pickle.loads(pickle.dumps(found.machine()))
    np.testing.assert_array_equal(machine.mass, found.machine().mass)
    hz = np.arange(1.0, 40.0)
    s = 2j * np.pi * hz
    table = mechid.ResponseTable(hz, s**2 / (2 * s**2 + 30 * s + 5000), quantity="acceleration")
    again = pickle.loads(pickle.dumps(copy.deepcopy(table)))
    assert mechid.identify_responses(again).parameters["m"].value == pytest.approx(2.0)
    responses = mechid.frf({"force": FORCE, "acc": ACC}, force="force", acceleration="acc", fs=FS, **PERIOD)
    np.testing.assert_array_equal(responses.to_frame()[1, 1], responses.response())
    assert len(repr(mechid.multisine(64, 64.0, lines="3:23"))) < 100

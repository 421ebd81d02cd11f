"""Makes `timetable73.mat` with mat-io 1.0.2 and h5py 3.16: timetables of MATLAB 7.3 with durations and with dates as the
times of their rows, with a time step and with a rate, and with units."""

import warnings

import matio
import numpy as np
import pandas as pd
from matio.utils.converters import mattables
from matio.utils.matclass import MatlabOpaque

warnings.simplefilter("ignore")
k = np.arange(8)
force = (k * k) % 7 - 3.0
x = 0.5**k


def table(index):
    return pd.DataFrame({"force": force, "x": x}, index=index)


def texts(*words):
    cells = np.empty((1, len(words)), dtype=object)
    for place, word in enumerate(words):
        cells[0, place] = np.array([word])
    return cells


def struct(fields):
    made = np.empty((1, 1), dtype=[(name, object) for name in fields])
    for name, value in fields.items():
        made[name][0, 0] = value
    return made


def even(**times):
    """A timetable whose rows have a step or a rate."""
    fields = mattables.timetable_to_mat(table(pd.to_timedelta(0.25 * k, unit="s")))["any"]
    fields["varUnits"][0, 0] = texts("kN", "mm")
    zero = np.array([[np.timedelta64(0, "ms")]])
    fields["rowTimes"][0, 0] = struct({"origin": zero, **times})
    return MatlabOpaque({"any": fields}, "timetable")


step = np.array([[np.timedelta64(250, "ms")]])
matio.save_to_mat("timetable73.mat", {
    "rows": table(pd.to_timedelta(0.25 * k, unit="s")),
    "dates": table(pd.Timestamp("2024-03-01T12:00:00") + pd.to_timedelta(0.25 * k, unit="s")),
    "step": even(specifiedAsRate=np.bool_(False), stepSize=step, sampleRate=np.float64(np.nan)),
    "rate": even(specifiedAsRate=np.bool_(True), stepSize=step, sampleRate=np.float64(4)),
}, version="v7.3")


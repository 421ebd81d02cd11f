"""Makes `arrays.mat` with SciPy 1.17, and `arrays73.mat` and `responses.h5` with h5py 3.16: cell arrays, arrays of structs,
and frequency responses as arrays of complex numbers.

The responses are H[line, point, reference] = (line + 1) + 10 point + 100 reference + i line: every value names its place.
"""

import h5py
import numpy as np
from scipy.io import savemat

k = np.arange(8)
time = 0.25 * k
force = (k * k) % 7 - 3.0
x = 0.5**k
hz = 2.0 + np.arange(5)
line, point, reference = np.meshgrid(np.arange(5), np.arange(3), np.arange(2), indexing="ij")
H = (line + 1.0) + 10.0 * point + 100.0 * reference + 1j * line
coherence = 1.0 - 0.01 * (1.0 + line[:, :, 0] + point[:, :, 0])

channels = np.zeros((1, 2), dtype=[("Name", object), ("Unit", object), ("Data", object)])
channels[0, 0] = ("hammer", "kN", force)
channels[0, 1] = ("tip", "g", x)
cells = np.empty((1, 3), dtype=object)
cells[0, 0], cells[0, 1], cells[0, 2] = force, "a text", np.column_stack([x, -x])
texts = np.empty((1, 2), dtype=object)
texts[0, 0], texts[0, 1] = "a", "b"
savemat("arrays.mat", {
    "rec": {"dt": 0.25, "Y": channels}, "cells": cells, "texts": texts,
    "one": {"unit": "mm", "time": time, "x": x},
})
# MATLAB's modalfrf has frequencies × outputs × inputs; a frequency response of the Control System Toolbox has
# outputs × inputs × frequencies.
savemat("responses.mat", {"f": hz.reshape(-1, 1), "H": H, "coh": coherence})
savemat("responses-last.mat", {"frf": {"freq": hz, "accelerance": np.moveaxis(H, 0, 2)}})
savemat("responses-vectors.mat", {"frequency": hz, "H11": H[:, 0, 0], "H_2_1": H[:, 1, 0]})

with h5py.File("responses.h5", "w") as file:
    file["run/frequency"] = hz
    file["run/frequency"].attrs["units"] = "kHz"
    file["run/mobility"] = H.astype(np.complex64)


def variable(place, name, value, kind="double"):
    data = np.atleast_2d(value)
    made = place.create_dataset(name, data=np.ascontiguousarray(data.T))
    made.attrs["MATLAB_class"] = np.bytes_(kind)
    return made


def text(place, name, value):
    variable(place, name, np.frombuffer(value.encode("utf-16-le"), dtype=np.uint16), "char")


with h5py.File("arrays73.mat", "w", userblock_size=512) as file:
    refs = file.create_group("#refs#")
    for name, value in [("a", force), ("b", x), ("c", np.column_stack([x, -x]))]:
        variable(refs, name, value)
    for name, value in [("d", "hammer"), ("e", "tip"), ("f", "kN"), ("g", "g")]:
        text(refs, name, value)
    rec = file.create_group("rec")
    rec.attrs["MATLAB_class"] = np.bytes_("struct")
    variable(rec, "dt", 0.25)
    y = rec.create_group("Y")
    y.attrs["MATLAB_class"] = np.bytes_("struct")
    for field, members in [("Name", "de"), ("Unit", "fg"), ("Data", "ab")]:
        made = y.create_dataset(field, (2, 1), dtype=h5py.ref_dtype)
        made[:, 0] = [refs[member].ref for member in members]
    cell = file.create_dataset("cells", (3, 1), dtype=h5py.ref_dtype)
    cell[:, 0] = [refs[member].ref for member in "adc"]
    cell.attrs["MATLAB_class"] = np.bytes_("cell")
    texts = file.create_dataset("texts", (2, 1), dtype=h5py.ref_dtype)
    texts[:, 0] = [refs[member].ref for member in "de"]
    texts.attrs["MATLAB_class"] = np.bytes_("cell")
    variable(file, "f", hz.reshape(-1, 1))
    kind = np.dtype([("real", "f8"), ("imag", "f8")])
    made = file.create_dataset("H", data=H.transpose().copy().view(kind))
    made.attrs["MATLAB_class"] = np.bytes_("double")

with open("arrays73.mat", "r+b") as file:
    file.write(b"MATLAB 7.3 MAT-file, made by h5py".ljust(124) + b"\x00\x02IM")

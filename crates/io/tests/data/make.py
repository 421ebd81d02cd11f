"""Makes the files beside it: SciPy 1.17.1 for MATLAB, pyuff 2.5.8 for universal files.

The numbers are short in binary and decimal, so that a test can write them down.
"""

import numpy as np
import pyuff
from scipy.io import savemat

k = np.arange(8)
time = 0.25 * k
force = (k * k) % 7 - 3.0
x = 0.5**k

variables = {
    "time": time,
    "force": force.reshape(-1, 1),
    "motion": np.column_stack([x, -x]),
    "fs": 4.0,
    "rig": {"x": x, "limits": {"low": k - 4.0}, "label": "rig 4"},
    "counts": np.arange(-4, 4, dtype=np.int16),
    "single": x.astype(np.float32),
    "short": np.array([1.0, 2.0, 3.0]),
    "gap": np.array([1.0, np.nan, 3.0]),
    "note": "a text",
    "analytic": x + 1j,
    "cells": np.array([1.0, "a"], dtype=object),
    "cube": np.ones((2, 2, 2)),
    "nothing": np.zeros((0, 0)),
}
savemat("plain.mat", variables, do_compression=False)
savemat("compressed.mat", variables, do_compression=True)


def function(data, **fields):
    common = {
        "type": 58, "id1": "rig 4", "rsp_node": 12, "rsp_dir": 3, "ref_node": 1, "ref_dir": -1,
        "abscissa_spacing": 1, "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 12,
        "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0, "func_type": 1, "x": time + 1.0,
        "data": data,
    }
    return common | fields


units = {"type": 164, "units_code": 1, "units_description": "SI: Meter (newton)", "temp_mode": 1,
         "length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15}
nodes = {"type": 15, "node_nums": [1, 12], "def_cs": [0, 0], "disp_cs": [0, 0], "color": [0, 0],
         "x": [0.0, 1.0], "y": [0.0, 0.0], "z": [0.0, 0.0]}
for name, binary in [("printed.unv", 0), ("binary.unv", 1)]:
    sets = [
        units,
        nodes,
        function(force, rsp_node=1, rsp_dir=-1, ordinate_spec_data_type=13,
                 ordinate_axis_units_lab="N", binary=binary),
        function(x, binary=binary),
        function(-x, rsp_dir=4, func_type=0, abscissa_spacing=0, binary=binary),
        function(x + 1j, func_type=4, abscissa_spec_data_type=18, binary=binary),
        function(x + 1j, rsp_node=3, rsp_dir=0, binary=binary),
    ]
    pyuff.UFF(name).write_sets(sets, mode="overwrite")
pyuff.UFF("single.unv").write_sets(
    [function(x, ord_data_type=2, binary=b, rsp_node=n) for b, n in [(0, 5), (1, 6), (1, 7)]],
    mode="overwrite", force_double=False)
# pyuff writes binary values as doubles whatever it says of them: put single ones in their place, in
# the last dataset with the highest byte first.
with open("single.unv", "rb") as file:
    content = file.read()
content = content.replace(x.tobytes(), x.astype("<f4").tobytes(), 1)
content = content.replace(x.tobytes(), x.astype(">f4").tobytes(), 1)
second = content.rindex(b"58b     1")
content = content[:second] + b"58b     2" + content[second + 9:]
with open("single.unv", "wb") as file:
    file.write(content)

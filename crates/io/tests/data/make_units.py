"""Makes `units.h5` with h5py: units, factors and offsets in attributes."""

import h5py
import numpy as np

k = np.arange(8)
hz = 2.0 + np.arange(5)
H = (hz + 1j).astype(np.complex128)

with h5py.File("units.h5", "w") as file:
    file.attrs["fs"] = 4.0
    file["frf/frequency"] = hz
    for name, attribute, unit in [("accelerance_1_1", "units", "g/N"), ("receptance_2_1", "unit", "um/N"), ("H_3_1", "units", "mV/N")]:
        file[f"frf/{name}"] = H
        file[f"frf/{name}"].attrs[attribute] = unit
    # The convention of netCDF: value = number * scale_factor + add_offset.
    packed = file.create_dataset("packed", data=(k - 4).astype("i2"))
    packed.attrs["scale_factor"], packed.attrs["add_offset"], packed.attrs["units"] = 0.25, 1.0, "kN"
    file["scaled"] = (k - 4).astype("i2")
    file["scaled"].attrs["scaling_factor"] = np.float32(0.5)
    file["two_scales"] = np.column_stack([k, k]).astype("i2")
    file["two_scales"].attrs["scale_factor"] = [0.5, 0.25]
    file["doubtful_offset"] = k.astype("i2")
    file["doubtful_offset"].attrs["scaling_factor"], file["doubtful_offset"].attrs["offset"] = 0.5, 3.0
    file["volts"] = k.astype("f8")
    file["volts"].attrs["engineering_units"] = "g"

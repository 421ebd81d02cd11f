"""Makes `unreadable.h5` with h5py: a record beside a data set without storage and others that are damaged."""

import h5py
import numpy as np

k = np.arange(8)

with h5py.File("unreadable.h5", "w", libver="earliest") as file:
    file.attrs["fs"] = 4.0
    file["force"] = k - 4.0
    file.create_dataset("reserve", (100_000_000,), chunks=(100_000,), dtype="f4")
    packed = file.create_dataset("packed", data=2.0 * k, chunks=(8,), compression="gzip")
    file.create_group("other/damaged")["x"] = 1.0 * k
    header = h5py.h5o.get_info(file["other/damaged"].id).addr
    chunk = packed.id.get_chunk_info(0).byte_offset

# The version of an object header, and the beginning of compressed numbers.
data = bytearray(open("unreadable.h5", "rb").read())
data[header] = 99
data[chunk : chunk + 8] = b"\xff" * 8
open("unreadable.h5", "wb").write(data)

"""Makes the HDF5 files beside it with h5py 3: data sets with attributes, and variables as MATLAB 7.3 lays them out.

MATLAB puts 512 bytes of its own before the file, writes the dimensions of an array in the other order, and names the
class of each variable in an attribute (`MATLAB_class`).
"""

import h5py
import numpy as np

k = np.arange(8)
time = 0.25 * k
force = (k * k) % 7 - 3.0
x = 0.5**k

with h5py.File("groups.h5", "w") as file:
    file.attrs["title"] = "rig 4"
    run = file.create_group("run 1")
    run.attrs["fs"] = 4.0
    channel = run.create_dataset("force", data=force, chunks=(4,), compression="gzip", shuffle=True)
    channel.attrs["units"] = "kN"
    motion = run.create_dataset("motion", data=np.column_stack([x, -x]).astype(np.float32))
    motion.attrs["unit"] = np.array(["mm", "um"], dtype=h5py.string_dtype())
    timed = file.create_group("run 2")
    timed.create_dataset("time", data=1e3 * time).attrs["units"] = "ms"
    timed.create_dataset("acc", data=x).attrs["unit_str"] = "g"
    counts = file.create_dataset("counts", data=np.arange(-4, 4, dtype=">i2"))
    counts.attrs["dt"] = 0.25
    counts.attrs["units"] = "counts"
    file.create_dataset("note", data="a text")
    file.create_dataset("analytic", data=x + 1j)
    file.create_dataset("cube", data=np.ones((2, 3, 4)))
    file.create_dataset("nothing", shape=(0,), dtype=float)

# Groups of the format before HDF5 1.8, the default of h5py: one of objects and links, one of links only.
with h5py.File("links.h5", "w", libver="earliest") as file:
    file.attrs["fs"] = 4.0
    run = file.create_group("run")
    run["force"], run["x"] = force, x
    file["first"] = h5py.SoftLink("/run/force")
    run["before"] = h5py.SoftLink("/run/x")
    run["missing"] = h5py.SoftLink("/nowhere")
    run["zero"] = -x
    file.create_group("links")["x"] = h5py.SoftLink("/run/x")


def matlab(place, name, value, kind="double"):
    data = np.atleast_2d(value)
    made = place.create_dataset(name, data=np.ascontiguousarray(data.T))
    made.attrs["MATLAB_class"] = np.bytes_(kind)
    return made


with h5py.File("matlab73.mat", "w", userblock_size=512) as file:
    matlab(file, "time", time.reshape(-1, 1))
    matlab(file, "force", force)
    matlab(file, "motion", np.column_stack([x, -x]))
    matlab(file, "single", x.astype(np.float32), "single")
    matlab(file, "fs", 4.0)
    rig = file.create_group("rig")
    rig.attrs["MATLAB_class"] = np.bytes_("struct")
    matlab(rig, "time", 2.0 * time.reshape(-1, 1))
    matlab(rig, "x", x.reshape(-1, 1))
    matlab(rig, "label", np.frombuffer("rig 4".encode("utf-16-le"), dtype=np.uint16), "char")
    empty = file.create_dataset("nothing", data=np.array([0, 0], dtype=np.uint64))
    empty.attrs["MATLAB_class"], empty.attrs["MATLAB_empty"] = np.bytes_("double"), np.uint8(1)
    cells = file.create_dataset("cells", (1, 1), dtype=h5py.ref_dtype)
    cells[0, 0] = file["force"].ref
    cells.attrs["MATLAB_class"] = np.bytes_("cell")

header = b"MATLAB 7.3 MAT-file, made by h5py".ljust(124) + b"\x00\x02IM"
with open("matlab73.mat", "r+b") as file:
    file.write(header)

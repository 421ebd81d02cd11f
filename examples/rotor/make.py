"""Makes the other files of this folder: the rotor of ROSS's first example (`rotor_example`) without its bearings, and
runs with trial weights on two oil-film bearings. Needs ross-rotordynamics 2.3.
"""

from pathlib import Path

import numpy as np
import ross as rs
from ross.rotor_assembly import rotor_example
from scipy.io import mmwrite
from scipy.sparse import coo_array

HERE = Path(__file__).parent
NODES, LATERAL = range(7), (0, 1, 3, 4)  # x, y and the slopes about them; without axial motion and torsion
NAMES = [f"{letter}{node}" for node in NODES for letter in ("x", "y", "a", "b")]
BEARINGS = {  # kxx, kxy, kyx, kyy in N/m; cxx … cyy in N·s/m
    0: ([1.2e6, 4e5, -3e5, 1.6e6], [1500, 200, 250, 2200]),
    6: ([2.0e6, -2e5, 6e5, 1.1e6], [1000, 150, 100, 1600]),
}
TRIAL, RESIDUAL, NOISE = 2e-4, -5e-5 + 1e-4j, 5e-8  # kg·m, kg·m at node 2, m

example = rotor_example()
rotor = rs.Rotor(example.shaft_elements, example.disk_elements)
chosen = [6 * node + dof for node in NODES for dof in LATERAL]
mass, stiffness, gyroscopic = (
    np.asarray(matrix)[np.ix_(chosen, chosen)] for matrix in (rotor.M(), rotor.K(0), rotor.G())
)
for name, matrix in [("mass", mass), ("stiffness", stiffness), ("gyroscopic", gyroscopic)]:
    kind = "general" if name == "gyroscopic" else "symmetric"
    mmwrite(HERE / f"{name}.mtx", coo_array(matrix), symmetry=kind)


def response(speed, unbalance):
    """Displacements of all degrees of freedom to unbalances by node, in kg·m."""
    dynamic = stiffness - speed**2 * mass + 1j * speed * speed * gyroscopic
    for node, (k, c) in BEARINGS.items():
        at = [NAMES.index(f"x{node}"), NAMES.index(f"y{node}")]
        dynamic[np.ix_(at, at)] += np.reshape(k, (2, 2)) + 1j * speed * np.reshape(c, (2, 2))
    load = np.zeros(len(NAMES), complex)
    for node, value in unbalance.items():
        load[NAMES.index(f"x{node}")] += value * speed**2
        load[NAMES.index(f"y{node}")] += -1j * value * speed**2
    return np.linalg.solve(dynamic, load)


random = np.random.default_rng(5)
probes = ["x1", "y1", "x5", "y5"]
columns = ["speed_rpm"] + [f"trial{n}_{part}" for n in (2, 4) for part in ("real", "imaginary")]
columns += [f"{p}_{part}" for p in probes for part in ("amplitude [um]", "phase_deg", "standard_error [um]")]
rows = []
for weights in ({}, {2: TRIAL}, {4: TRIAL}):
    for rpm in np.arange(500, 3001, 250):
        total = dict(weights)
        total[2] = total.get(2, 0) + RESIDUAL
        x = response(rpm * np.pi / 30, total)
        row = [f"{rpm}"] + [f"{weights.get(n, 0):g}" if part == 0 else "0" for n in (2, 4) for part in (0, 1)]
        for probe in probes:
            z = x[NAMES.index(probe)] + NOISE * complex(*random.standard_normal(2))
            row += [f"{abs(z) * 1e6:.4f}", f"{np.degrees(np.angle(z)):.3f}", f"{NOISE * 1e6:g}"]
        rows.append(row)
(HERE / "runs.csv").write_text("\n".join(",".join(row) for row in [columns, *rows]) + "\n")

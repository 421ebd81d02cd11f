"""Modes, responses, quantiles, a logarithm and spectra by SciPy 1.17.1 and NumPy 2.4.6: scipy.csv."""

import numpy as np
from scipy import linalg, signal, stats


def row(what, index, part, value):
    print(f"{what},{index},{part},{float(value)!r}")


def congruence(seed, count):
    values = []
    for _ in range(count):
        seed = (1103515245 * seed + 12345) % 2**31
        values.append(seed / 2**31 - 0.5)
    return np.array(values)


MASS = np.array([[4, 0.5, 0], [0.5, 3, 0.2], [0, 0.2, 2]])
DAMPING = np.array([[8, 12, -1], [-14, 9, 0.5], [-1, 0.5, 4.0]])
STIFFNESS = np.array([[9000, -3000, 0], [-2500, 7000, -1500], [0, -1500, 4000.0]])
DT, STEPS = 0.01, 60
print("what,index,part,value")

state = np.block([
    [np.zeros((3, 3)), np.eye(3)],
    [-linalg.solve(MASS, STIFFNESS), -linalg.solve(MASS, DAMPING)],
])
poles = sorted((pole for pole in linalg.eigvals(state) if pole.imag > 0), key=abs)
for i, pole in enumerate(poles, 1):
    row("eigenvalue", i, "real", pole.real)
    row("eigenvalue", i, "imaginary", pole.imag)

for hz in (1.0, 5.0, 7.5, 10.0, 25.0):
    s = 2j * np.pi * hz
    receptance = linalg.inv(MASS * s * s + DAMPING * s + STIFFNESS)[:, 0]
    for i, entry in enumerate(receptance, 1):
        row("receptance", hz, f"{i}1 real", entry.real)
        row("receptance", hz, f"{i}1 imaginary", entry.imag)

t = np.arange(STEPS + 1) * DT
force = 30 * np.sin(18 * t) + 12 * np.sin(47 * t)
entry = np.vstack([np.zeros((3, 1)), linalg.solve(MASS, np.array([[0], [1.0], [0]]))])
displacements = np.hstack([np.eye(3), np.zeros((3, 3))])
_, motion, _ = signal.lsim((state, entry, displacements, np.zeros((3, 1))), force, t)
for k in range(6, STEPS + 1, 6):
    for i in range(3):
        row("response", k, i + 1, motion[k, i])

for freedom in (1, 2, 3, 5, 10, 30, 100, 1000):
    for level in (0.5, 0.9, 0.95, 0.99):
        row("student", freedom, level, stats.t.ppf(0.5 + level / 2, freedom))

logarithm = linalg.logm(linalg.expm(state * DT))
for i in range(6):
    for j in range(6):
        row("logarithm", i + 1, j + 1, logarithm[i, j].real)

drive = congruence(12345, 2048)
filtered = np.zeros(2048)
for k in range(2048):
    filtered[k] = (
        drive[k] * 0.2
        + (1.6 * filtered[k - 1] + drive[k - 1] if k > 0 else 0)
        - (0.8 * filtered[k - 2] if k > 1 else 0)
    )
filtered += 0.5 * congruence(54321, 2048)
welch = {"fs": 256.0, "window": "hann", "nperseg": 256, "noverlap": 128, "detrend": "constant"}
_, power = signal.welch(drive, **welch)
_, cross = signal.csd(drive, filtered, **welch)
_, coherence = signal.coherence(drive, filtered, **welch)
for k in (5, 10, 20, 26, 30, 40, 60, 90, 120):
    row("h1", k, "real", (cross / power)[k].real)
    row("h1", k, "imaginary", (cross / power)[k].imag)
    row("coherence", k, "", coherence[k])

"""Makes frame.csv: two storeys on a shake table under random motion. The response is computed exactly at 16 times the
sample rate, then filtered against aliasing and sampled; noise is added. Needs NumPy and SciPy.
"""

from pathlib import Path

import numpy as np
from scipy.linalg import expm
from scipy.signal import butter, firwin, sosfilt

MASS, STIFFNESS, DAMPING = np.diag([120.0, 100.0]), (2e5, 1.5e5), (150.0, 90.0)
RATE, OVER, SAMPLES, NOISE = 64, 16, 1536, 0.004

shear = lambda v: np.array([[v[0] + v[1], -v[1]], [-v[1], v[1]]])
K, C = shear(STIFFNESS), shear(DAMPING)
random = np.random.default_rng(7)
count, rate = SAMPLES * OVER + 64 * OVER, RATE * OVER
ground = sosfilt(butter(4, [0.5, 20], "bandpass", fs=rate, output="sos"), random.standard_normal(count))
ground /= ground.std()  # m/s²
# The displacement z relative to the table follows from M z¨ + C z˙ + K z = −M 1 a; the acceleration a of the table is linear
# between samples.
A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(MASS, K), -np.linalg.solve(MASS, C)]])
B = np.r_[0, 0, -1, -1.0]
big = np.zeros((6, 6))
big[:4, :4], big[:4, 4], big[4, 5] = A / rate, B / rate, 1
step = expm(big)
state, absolute = np.zeros(4), np.empty((count, 2))
for at in range(count):
    relative = A[2:] @ state - ground[at]
    absolute[at] = relative + ground[at]
    if at + 1 < count:
        state = step[:4] @ np.r_[state, ground[at], ground[at + 1] - ground[at]]
low = firwin(64 * OVER + 1, 0.8 / OVER)
channels = [np.convolve(signal, low, "same")[64 * OVER :: OVER] for signal in (ground, *absolute.T)]
table = np.stack([channel + NOISE * random.standard_normal(SAMPLES) for channel in channels], 1)
time = np.arange(SAMPLES) / RATE
lines = [f"{t:.6f}," + ",".join(f"{value:.4f}" for value in row) for t, row in zip(time, table)]
header = "time,table [m/s^2],first [m/s^2],roof [m/s^2]\n"
(Path(__file__).parent / "frame.csv").write_text(header + "\n".join(lines) + "\n")

"""Identifies the modes of a frame of eight storeys from one shaker and eight accelerometers.

Prints each natural frequency and damping ratio with its standard error and the true frequency, then
the full result with shapes and checks.
"""

# %% Eight storeys of 40 kg on columns of 0.1 MN/m, with proportional damping.
import numpy as np

import mechid

STOREYS, FS, PERIOD = 8, 64.0, 1024
stiffness = 1.0e5 * (2.0 * np.eye(STOREYS) - np.eye(STOREYS, k=1) - np.eye(STOREYS, k=-1))
stiffness[-1, -1] = 1.0e5
mass = 40.0 * np.eye(STOREYS)
frame = mechid.Machine(mass, 0.3 * mass + 2.0e-4 * stiffness, stiffness)

# %% The shaker excites the top storey from 1 to 25 Hz; the accelerometers have white noise.
shaker = mechid.multisine(PERIOD, FS, lines="16:400", amplitude=20.0).force
forces = np.zeros((PERIOD, STOREYS))
forces[:, -1] = shaker
response = mechid.integrate(frame, forces, FS, scheme="exact", response="periodic")
noise = np.random.default_rng(1).normal(0.0, 0.01, forces.shape)
acceleration = response["acceleration"] + noise

# %% Identify the modes, and compare them with those of the frame.
found = mechid.modes(shaker, acceleration=acceleration, fs=FS, period=PERIOD)
for mode, true in zip(found.modes, frame.modes, strict=True):
    frequency, ratio = mode.natural_frequency_hz, mode.damping_ratio
    true_hz = true.natural_frequency_hz.value
    assert frequency.std_error is not None and ratio.std_error is not None
    print(
        f"{frequency.value:.6f} ± {frequency.std_error:.6f} Hz (true {true_hz:.6f}), "
        f"damping ratio {100 * ratio.value:.5f} ± {100 * ratio.std_error:.5f} %"
    )
    assert abs(frequency.value - true_hz) < 5 * frequency.std_error
print(f"\n{found}")

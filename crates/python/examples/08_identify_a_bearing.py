"""Identifies the eight coefficients of a bearing and the modes of its rotor.

The film couples two directions, and its matrices are not symmetric. The test excites both
directions with multisines on different lines, so that one experiment determines all entries of C
and K; the mass is known from a balance.

Prints the result with its checks, each coefficient with its distance from the truth in standard
errors, and the natural frequency and the damping ratio of each mode.
"""

# %% The rig, in the form that `mechid simulate` reads, too.
import numpy as np

import mechid

MASS, FS, PERIOD, PERIODS = 14.8, 512.0, 1024, 8
C = np.array([[2200.0, 900.0], [900.0, 3100.0]])
K = np.array([[2.1e6, 1.4e6], [-0.6e6, 3.0e6]])
rig = {
    "system": {
        "mass": [[MASS, 0.0], [0.0, MASS]],
        "damping": C.tolist(),
        "stiffness": K.tolist(),
    },
    "sampling": {"samples": PERIOD, "rate_hz": FS},
    "excitation": [
        {"dof": 1, "lines": "20:2:240", "amplitude": 30.0},
        {"dof": 2, "lines": "21:2:241", "amplitude": 30.0},
    ],
    "periods": PERIODS,
    "noise": {"displacement": {"fraction_of_rms": 0.02}, "seed": 4},
}
run = mechid.simulate(rig)

# %% Identify with the mass known.
found = mechid.identify(
    run.force, run.displacement, fs=run.fs, period=PERIOD, method="maximum-likelihood",
    mass=[MASS, MASS],
)
print(found)

# %% Compare every coefficient with the truth, within four standard errors.
for truth, letter in ((C, "c"), (K, "k")):
    for row in range(2):
        for column in range(2):
            parameter = found.parameters[f"{letter}{row + 1}{column + 1}"]
            assert parameter.std_error is not None
            apart = (parameter.value - truth[row, column]) / parameter.std_error
            print(f"{parameter.name}: {parameter.value:12.1f} {parameter.unit}, {apart:+.1f} standard errors off")
            assert abs(apart) < 4

# %% Modes with their uncertainty; an unstable mode would have a positive real part.
for mode in found.modes:
    ratio = mode.damping_ratio
    print(f"{mode.natural_frequency_hz.value:.2f} Hz, ζ = {ratio.value:.4f} ± {ratio.std_error:.4f}")

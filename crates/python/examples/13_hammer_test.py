"""Identifies a machine from a hammer test, and reconstructs a hit.

Prints the averaged frequency response of five hits, the machine that fits it with the warnings of
the checks, the reconstructed force of a sixth hit, and its true and reconstructed peak.
"""

# %% Five hits on one mass; every record begins a little before the hit and ends at rest.
import numpy as np

import mechid

FS, SAMPLES = 1024.0, 4096
machine = mechid.Machine(3.2, 24.0, 5.1e4)
rng = np.random.default_rng(7)


def blow(peak: float) -> np.ndarray:
    """A half-sine of 4 ms."""
    force = np.zeros(SAMPLES)
    length = round(0.004 * FS)
    force[100 : 100 + length] = peak * np.sin(np.pi * np.arange(length) / length)
    return force


blows = [blow(peak) for peak in (90.0, 120.0, 100.0, 140.0, 110.0)]
force = np.concatenate(blows)
motion = mechid.predict(machine, force, FS)["displacement"][:, 0]
measured = motion + rng.normal(0.0, 1e-3 * motion.std(), len(motion))

# %% The hits are the segments, with equal weights: each begins and ends at rest.
record = mechid.Measurement.from_arrays(force, measured, fs=FS)
table = mechid.frf(
    record, segment=f"{SAMPLES}:0:rectangular", band_hz=(5.0, 60.0)
)
print(table)
judge = machine.receptance(table.frequency_hz)[:, 0, 0]
apart = np.abs(table.response() - judge) / np.abs(judge).max()
assert apart.max() < 0.02, apart.max()

# %% Identify the machine.
found = mechid.identify(
    record, from_frf="h1", segment=f"{SAMPLES}:0:rectangular",
    band_hz=(5.0, 60.0),
)
print(found)
assert abs(found.parameters["k"].value / 5.1e4 - 1) < 0.01

# %% Reconstruct a hit that no load cell has measured.
unseen = blow(130.0)
response = mechid.predict(machine, unseen, FS)
noisy = {
    name: response[name][:, 0] + rng.normal(0.0, 1e-4 * response[name].std(), SAMPLES)
    for name in ("displacement", "velocity")
}
again = mechid.reconstruct(found, **noisy, fs=FS, at_rest=True)  # type: ignore[arg-type]
print(again)
print(f"peak of {unseen.max():.1f} N, found {again.force.max():.1f} N")
assert abs(again.force.max() / unseen.max() - 1) < 0.1

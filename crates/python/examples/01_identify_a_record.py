"""Identifies a machine from a file with one call.

Prints mass, damping and stiffness, natural frequency and damping ratio with their intervals, the
result of the checks, and the warnings (none for this record).
"""

# %% The identification, from a file with two periods of 256 samples.
from pathlib import Path

import mechid

record = Path(__file__).parents[3] / "examples/machine.csv"
found = mechid.identify(
    record, force="force", displacement="displacement", period=256, method="maximum-likelihood"
)
print(found)

# %% Read the warnings before you use the numbers.
for warning in found.warnings:
    print(f"warning: {warning.text}")
assert not found.warnings

"""Tests whether the standard errors are reliable: repeats an experiment with new noise, in parallel
threads.

Prints the share of the runs with a warning and, for each parameter, the scatter of the estimates,
the stated standard error, and the share of the runs whose interval contains the truth.
"""

# %% One period of a multisine on a known machine; the response is exact.
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import mechid

FS, PERIOD, PERIODS, RUNS = 128.0, 256, 8, 400
TRUTH = {"m": 25.0, "c": 188.5, "k": 142_122.0}
machine = mechid.Machine(TRUTH["m"], TRUTH["c"], TRUTH["k"])
drive = mechid.multisine(PERIOD, FS, lines="4:60", amplitude=2.0)
response = mechid.integrate(machine, drive.force, FS, scheme="exact", response="periodic")
force, motion = np.tile(drive.force, PERIODS), np.tile(response["displacement"][:, 0], PERIODS)


# %% Each run has different noise; threads share the work, because the interpreter's lock is released.
def run(seed: int) -> tuple[list[float], list[float], bool]:
    noise = np.random.default_rng([1998, seed]).normal(0.0, 0.02 * motion.std(), len(motion))
    found = mechid.identify(
        force, motion + noise, fs=FS, period=PERIOD, method="maximum-likelihood", threads=1
    )
    rows = [found.parameters[name] for name in TRUTH]
    widened = [one for one in found.warnings if one.subject in ("parts", "alternative", "misfit")]
    return [row.value for row in rows], [row.std_error or 0.0 for row in rows], bool(widened)


with ThreadPoolExecutor() as pool:
    runs = list(pool.map(run, range(RUNS)))
values, errors, warned = (np.array(part) for part in zip(*runs, strict=True))
print(f"{100 * warned.mean():.1f} % of the runs have a warning by chance, and larger errors")
assert warned.mean() <= 0.02

# %% Compare the scatter of the estimates with the standard errors of each estimate.
for column, (name, truth) in enumerate(TRUTH.items()):
    scatter, stated = values[:, column].std(), np.sqrt((errors[~warned, column] ** 2).mean())
    bias = (values[:, column].mean() - truth) / (scatter / np.sqrt(RUNS))
    inside = (np.abs(values[:, column] - truth) < 1.96 * errors[:, column]).mean()
    print(f"{name}: scatter {scatter:.4g}, stated {stated:.4g}, {100 * inside:.1f} % within 1.96 of them")
    assert abs(scatter / stated - 1) < 0.15 and abs(bias) < 4
    assert 0.90 < inside < 0.99

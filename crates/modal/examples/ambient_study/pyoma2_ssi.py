"""Errors of pyOMA2 over those of `identify_ambient`, on the same records.

    cargo run --release -p mechid-modal --example ambient_study -- 20 0 FOLDER
    pip install pyOMA-2==1.4.3
    python crates/modal/examples/ambient_study/pyoma2_ssi.py FOLDER

Covariance-driven subspace models (SSI-cov) up to order 40 with 20 and 40 block rows. Of each order
the pole nearest to the true one, which a user does not know; then the order and the block rows with
the smallest error, mode by mode, among those that see every mode in 90 % of the records. Its 95 %
intervals are those of this order, from 50 blocks of the record.
"""

import logging
import sys
import warnings
from pathlib import Path

import numpy as np
from pyoma2.algorithms import SSI
from pyoma2.setup import SingleSetup

BLOCK_ROWS = (20, 40)
ORDERS = 40
LIMITS = {"xi_max": 0.2, "mpc_lim": None, "mpd_lim": None, "CoV_max": None}


def nearest(frequencies, dampings, errors, true):
    """Return errors of f and ζ and standard errors of both, for each true mode; NaN beyond five half-widths."""
    result = np.full((len(true), 4), np.nan)
    for k, (hz, zeta) in enumerate(true):
        distance = np.abs(frequencies - hz)
        if np.isfinite(distance).any():
            at = np.nanargmin(distance)
            # A pole counts for one mode only: below the true order one pole stands for two modes.
            own = np.argmin(np.abs(frequencies[at] - true[:, 0])) == k
            if own and distance[at] < 5 * zeta * hz:
                result[k] = frequencies[at] - hz, dampings[at] - zeta, *errors[:, at]
    return result


def subspace(data, rate_hz, block_rows, true):
    """Return the same for each even order."""
    setup = SingleSetup(data, fs=rate_hz)
    method = SSI(name="ssi", method="cov", br=block_rows, ordmax=ORDERS, hc=LIMITS, calc_unc=True)
    setup.add_algorithms(method)
    setup.run_by_name("ssi")
    found = method.result
    columns = range(2, ORDERS + 1, 2)
    return [nearest(found.Fn_poles[:, n], found.Xi_poles[:, n],
                    np.array([found.Fn_poles_std[:, n], found.Xi_poles_std[:, n]]), true) for n in columns]


def rms(values):
    """Return the root-mean-square over the records that have the mode."""
    return np.sqrt(np.nanmean(np.square(values), axis=0))


def main(folder):
    for path in sorted(folder.glob("*.modes.csv")):
        name = path.name.removesuffix(".modes.csv")
        rows = [line.split(",") for line in path.read_text().splitlines()[1:]]
        true = np.array([row[1:] for row in rows if row[0] == "true"], float)
        rate_hz = next(float(row[1]) for row in rows if row[0] == "rate")
        seeds = sorted({int(row[0]) for row in rows if row[0].isdigit()})
        ours, usual = [], []
        for seed in seeds:
            mine = np.array([row[1:] for row in rows if row[0] == str(seed)], float)
            ours.append(nearest(mine[:, 0], mine[:, 1], np.zeros((2, len(mine))), true)[:, :2])
            data = np.loadtxt(folder / f"{name}-{seed}.csv", delimiter=",", ndmin=2)
            usual.append([subspace(data, rate_hz, block_rows, true) for block_rows in BLOCK_ROWS])
        # Records × settings (block rows, order) × modes × (error of f, of ζ, their standard errors).
        usual = np.array(usual).reshape(len(seeds), -1, len(true), 4)
        sees = (np.isfinite(usual[..., 0]).mean(axis=0) >= 0.9).all(axis=1)
        print(f"{name}, {len(seeds)} records: RMS errors of pyOMA2 over those of identify_ambient; its intervals")
        for k, (hz, _) in enumerate(true):
            text = f"{hz:8.2f} Hz"
            for part, letter in enumerate(("f", "zeta")):
                errors = np.where(sees, rms(usual[:, :, k, part]), np.inf)
                best = np.argmin(errors)
                inside = np.abs(usual[:, best, k, part]) < 1.96 * usual[:, best, k, 2 + part]
                ratio = errors[best] / rms(np.array(ours)[:, k, part])
                rows_of_blocks, order = BLOCK_ROWS[best // (ORDERS // 2)], 2 * (best % (ORDERS // 2)) + 2
                text += f"  {letter} {ratio:5.2f} ({order}, {rows_of_blocks}; {100 * inside.mean():.0f} %)"
            print(text)


if __name__ == "__main__":
    warnings.filterwarnings("ignore")
    logging.disable(logging.INFO)
    main(Path(sys.argv[1]))

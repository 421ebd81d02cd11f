"""Errors of sdypy-EMA over those of `identify_modes`, on the same records.

    cargo run --release -p mechid-modal --example modal_rivals -- 20 FOLDER
    pip install sdypy-EMA==0.31.0 scipy
    python crates/modal/examples/modal_rivals/sdypy_ema.py FOLDER

Random forces: H1 of all forces from Hann-windowed segments with half of each in the next one. Hits:
H1 of blocks from every hit on, with an exponential window. Then the poles of LSCF up to order 60
nearest to the true frequencies, which a user does not know, and the best setting of each mode.
"""

import sys
import warnings
from pathlib import Path

import numpy as np
from scipy import signal
from sdypy import EMA

RATE_HZ = 1024.0
SEGMENTS = (1024, 2048, 4096)
HIT_SAMPLES = 800
WINDOW_ENDS = (0.01, 0.1, 0.5, 1.0)


def hann(forces, motion, samples):
    """Return frequencies in Hz, and H1 as (outputs × forces, lines)."""
    settings = {"fs": RATE_HZ, "window": "hann", "nperseg": samples, "noverlap": samples // 2}
    def cross(a, b):
        return np.array([[signal.csd(y, x, **settings)[1] for y in b] for x in a])
    frequency = np.fft.rfftfreq(samples, 1 / RATE_HZ)
    forced = np.moveaxis(cross(forces, forces), 2, 0)
    both = np.moveaxis(cross(motion, forces), 2, 0)
    response = both @ np.linalg.pinv(forced)
    return frequency, np.moveaxis(response, 0, 2).reshape(-1, len(frequency)), 0.0


def exponential(forces, motion, end):
    """Return the same from the blocks of a hammer test, and the decay rate that the window adds."""
    force = forces[0]
    above = np.flatnonzero(force > 0.3 * force.max())
    starts = [k - 5 for k in above[np.insert(np.diff(above) > HIT_SAMPLES // 2, 0, True)]]
    starts = [k for k in starts if 0 <= k and k + HIT_SAMPLES <= len(force)]
    decay = -np.log(end) / (HIT_SAMPLES / RATE_HZ)
    window = np.exp(-decay * np.arange(HIT_SAMPLES) / RATE_HZ)
    blocks = [(force[k : k + HIT_SAMPLES] * window, motion[:, k : k + HIT_SAMPLES] * window) for k in starts]
    spectra = [(np.fft.rfft(f), np.fft.rfft(x)) for f, x in blocks]
    power = sum(np.abs(f) ** 2 for f, _ in spectra)
    response = sum(x * f.conj() for f, x in spectra) / power
    return np.fft.rfftfreq(HIT_SAMPLES, 1 / RATE_HZ), response, decay


def poles(frequency, response, decay, band_hz, true):
    """Return frequencies and damping ratios of the poles next to each true mode: medians over the orders."""
    model = EMA.Model(response, frequency, lower=band_hz[0], upper=band_hz[1],
                      pol_order_high=60, frf_form="accelerance")
    model.get_poles(show_progress=False)
    result = np.full(true.shape, np.nan)
    for k, (hz, zeta) in enumerate(true):
        near = []
        for all_hz, all_zeta in zip(model.pole_freq, model.pole_xi):
            all_hz, all_zeta = np.atleast_1d(all_hz), np.atleast_1d(all_zeta)
            inside = (all_zeta > 0) & (all_zeta < 0.2) & (np.abs(all_hz - hz) < 5 * zeta * hz)
            if inside.any():
                at = np.argmin(np.where(inside, np.abs(all_hz - hz), np.inf))
                near.append((all_hz[at], all_zeta[at]))
        if near:
            found_hz, found_zeta = np.median(near, axis=0)
            result[k] = found_hz, found_zeta - decay / (2 * np.pi * found_hz)
    return result


def errors(estimates, true):
    """Return the errors of the estimates nearest to each true mode; NaN beyond five half-widths."""
    result = np.full(true.shape, np.nan)
    for k, (hz, zeta) in enumerate(true):
        distance = np.abs(estimates[:, 0] - hz)
        if np.isfinite(distance).any():
            nearest = estimates[np.nanargmin(distance)]
            if abs(nearest[0] - hz) < 5 * zeta * hz:
                result[k] = nearest - (hz, zeta)
    return result


def rms(values):
    """Return the root-mean-square over the records that have the mode."""
    return np.sqrt(np.nanmean(np.square(values), axis=0))


def main(folder):
    for path in sorted(folder.glob("*.modes.csv")):
        name = path.name.removesuffix(".modes.csv")
        rows = [line.split(",") for line in path.read_text().splitlines()[1:]]
        true = np.array([row[1:] for row in rows if row[0] == "true"], float)
        band_hz = next([float(hz) for hz in row[1:]] for row in rows if row[0] == "band")
        seeds = sorted({int(row[0]) for row in rows if row[0].isdigit()})
        ours, usual = [], []
        for seed in seeds:
            mine = np.array([row[1:] for row in rows if row[0] == str(seed)], float)
            ours.append(errors(mine, true))
            text = (folder / f"{name}-{seed}.csv").read_text().splitlines()
            inputs = sum(column.startswith("f") for column in text[0].split(","))
            data = np.loadtxt(text[1:], delimiter=",").T
            forces, motion = data[:inputs], data[inputs:]
            ways = ([exponential(forces, motion, end) for end in WINDOW_ENDS] if "hammer" in name
                    else [hann(forces, motion, samples) for samples in SEGMENTS])
            usual.append([errors(poles(*way, band_hz, true), true) for way in ways])
        ratio = np.nanmin(rms(np.array(usual)), axis=0) / rms(np.array(ours))
        print(f"{name}, {len(seeds)} records: RMS errors of sdypy-EMA over those of identify_modes")
        for (hz, _), (f, zeta) in zip(true, ratio):
            print(f"{hz:8.1f} Hz  f {f:7.1f}  zeta {zeta:7.1f}")


if __name__ == "__main__":
    warnings.filterwarnings("ignore")
    main(Path(sys.argv[1]))

"""Speed and accuracy beside SciPy, in one run: prints a table.

SciPy does what it does best in each row; both answers are held against the same truth, and the least
time of several repeats counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import optimize, signal

import mechid

MACHINE = mechid.Machine(25.0, 188.5, 142_122.0)
TWO = mechid.Machine(np.diag([2.0, 3.0]), [[4.0, 1.0], [-2.0, 5.0]], [[900.0, -200.0], [300.0, 700.0]])


def timed(work: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    best, answer = np.inf, None
    for _ in range(repeats):
        begin = time.perf_counter()
        answer = work()
        best = min(best, time.perf_counter() - begin)
    return best, answer


def row(task: str, theirs: tuple[float, float], ours: tuple[float, float]) -> None:
    ratio = theirs[0] / ours[0]
    print(
        f"| {task} | {1e3 * theirs[0]:.3g} ms | {1e3 * ours[0]:.3g} ms | {ratio:.1f} "
        f"| {theirs[1]:.1e} | {ours[1]:.1e} |",
        flush=True,
    )


def stepping(machine: mechid.Machine, task: str, samples: int) -> None:
    """A force that is linear between samples: both are exact; SciPy by `lsim`."""
    rng = np.random.default_rng(1)
    fs, dofs = 256.0, len(machine.mass)
    force, t = rng.standard_normal((samples, dofs)), np.arange(samples) / fs
    system = signal.StateSpace(*machine.state_space())
    theirs, (_, judge, _) = timed(lambda: signal.lsim(system, force, t), 3)
    judge = np.reshape(judge, (samples, dofs))
    ours, found = timed(lambda: mechid.predict(machine, force, fs)["displacement"], 5)
    apart = float(np.abs(found - judge).max() / np.abs(judge).max())
    row(task, (theirs, apart), (ours, apart))


def filtering(samples: int) -> None:
    """A force that is held between samples; SciPy by `cont2discrete` and `lfilter`."""
    rng = np.random.default_rng(2)
    fs = 256.0
    force = rng.standard_normal(samples)

    def theirs() -> np.ndarray:
        a, b, c, d = MACHINE.state_space()
        held = signal.cont2discrete((a, b, c, d), 1 / fs, method="zoh")
        numerator, denominator = signal.ss2tf(*held[:4])
        return np.asarray(signal.lfilter(numerator[0], denominator, force))

    slow, judge = timed(theirs, 5)
    fast, found = timed(
        lambda: mechid.predict(MACHINE, force, fs, between_samples="held")["displacement"][:, 0], 5
    )
    apart = float(np.abs(found - judge).max() / np.abs(judge).max())
    row(f"held force, {samples:,} samples (`lfilter`)", (slow, apart), (fast, apart))


def responses(samples: int, segment: int) -> None:
    """H1 by Welch's method; SciPy by `csd` and `welch`, on the same segments."""
    rng = np.random.default_rng(3)
    fs = 256.0
    force = rng.standard_normal(samples)
    x = mechid.predict(MACHINE, force, fs)["displacement"][:, 0]
    x = x + rng.normal(0.0, 0.01 * x.std(), samples)
    how: dict[str, Any] = {"fs": fs, "nperseg": segment, "detrend": False}

    def theirs() -> np.ndarray:
        _, cross = signal.csd(force, x, **how)
        frequency, power = signal.welch(force, **how)
        return np.asarray(cross / power)[(frequency >= 5) & (frequency <= 40)]

    def ours() -> np.ndarray:
        found = mechid.frf(force, x, fs=fs, segment=segment, band_hz=(5.0, 40.0))
        return found.response()

    slow, judge = timed(theirs, 5)
    fast, found = timed(ours, 5)
    frequency = np.fft.rfftfreq(segment, 1 / fs)
    truth = MACHINE.receptance(frequency[(frequency >= 5) & (frequency <= 40)])[:, 0, 0]
    errors = [float(np.linalg.norm(h - truth) / np.linalg.norm(truth)) for h in (judge, found)]
    row(f"H1, {samples:,} samples in segments of {segment} (`csd`, `welch`)", (slow, errors[0]),
        (fast, errors[1]))


def fitting(periods: int) -> None:
    """Output error on spectra; SciPy by `least_squares`, scaled and started at a tenth off."""
    fs, period = 128.0, 256
    truth = np.array([25.0, 188.5, 142_122.0])
    drive = mechid.multisine(period, fs, lines="4:60", amplitude=2.0)
    exact = mechid.integrate(MACHINE, drive.force, fs, scheme="exact", response="periodic")
    force, motion = np.tile(drive.force, periods), np.tile(exact["displacement"][:, 0], periods)
    motion += np.random.default_rng(4).normal(0.0, 0.01 * motion.std(), len(motion))
    lines = np.array(drive.lines)
    omega = 2 * np.pi * lines * fs / period

    def theirs() -> np.ndarray:
        spectra = [np.fft.rfft(v.reshape(periods, period).mean(axis=0))[lines] for v in (force, motion)]

        def residual(scaled: np.ndarray) -> np.ndarray:
            m, c, k = scaled * truth
            apart = spectra[1] - spectra[0] / (k - omega**2 * m + 1j * omega * c)
            return np.concatenate([apart.real, apart.imag]) / np.abs(spectra[1]).max()

        found = optimize.least_squares(residual, np.full(3, 1.1), xtol=1e-12, ftol=1e-12, gtol=1e-12)
        return np.asarray(found.x * truth)

    def ours() -> np.ndarray:
        found = mechid.identify(force, motion, fs=fs, period=period, method="maximum-likelihood")
        return np.array([found.parameters[name].value for name in ("m", "c", "k")])

    slow, judge = timed(theirs, 10)
    fast, found = timed(ours, 10)
    errors = [float(np.abs(values / truth - 1).max()) for values in (judge, found)]
    row(f"output error, {periods} periods of {period} (`least_squares`), with checks and intervals",
        (slow, errors[0]), (fast, errors[1]))


def overhead() -> None:
    """What a call costs beyond the work: a call of 1,024 × 2 samples that fails at once."""
    force, x = np.random.default_rng(5).standard_normal((2, 1024))
    record = mechid.Measurement.from_arrays(force, x, fs=128.0)

    def copying() -> None:
        for _ in range(1000):
            mechid.Measurement.from_arrays(force, x, fs=128.0)

    def refused() -> None:
        for _ in range(1000):
            try:
                # The settings are read in the call, the failure comes from the other thread.
                mechid.identify(record, method="least-squares", lines="2000")
            except mechid.MechidError:
                pass

    copy, _ = timed(copying, 5)
    call, _ = timed(refused, 5)
    print(f"\ncopying in 1,024 × 2 samples: {1e3 * copy:.1f} µs; a call to and fro, failure told: {1e3 * call:.1f} µs")


def main() -> None:
    print("| Task | SciPy | mechid | ratio | error, SciPy | error, mechid |")
    print("|---|---|---|---|---|---|")
    stepping(MACHINE, "linear force, 100,000 samples (`lsim`)", 100_000)
    stepping(TWO, "the same, two degrees of freedom", 100_000)
    filtering(1_000_000)
    responses(262_144, 1024)
    fitting(8)
    fitting(1024)
    overhead()


if __name__ == "__main__":
    main()

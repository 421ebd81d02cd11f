"""Speed and accuracy compared with SciPy, in one run: prints a table.

Each row uses the best method of SciPy; both results are compared with the same truth, and the
shortest time of several repetitions counts.
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


def filtering(samples: int, outputs: int) -> None:
    """A force that is held between samples; SciPy by `cont2discrete` and `lfilter`.

    `predict` computes displacement, velocity and acceleration; a filter computes one of them.
    """
    rng = np.random.default_rng(2)
    fs = 256.0
    force = rng.standard_normal(samples)
    kinds = ("displacement", "velocity", "acceleration")[:outputs]

    def theirs() -> list[np.ndarray]:
        a, b, _, _ = MACHINE.state_space()
        spaces = [MACHINE.state_space(kind) for kind in kinds]  # type: ignore[arg-type]
        c, d = (np.concatenate([space[at] for space in spaces]) for at in (2, 3))
        held = signal.cont2discrete((a, b, c, d), 1 / fs, method="zoh")
        numerators, denominator = signal.ss2tf(*held[:4])
        return [np.asarray(signal.lfilter(top, denominator, force)) for top in numerators]

    slow, judges = timed(theirs, 5)
    fast, found = timed(lambda: mechid.predict(MACHINE, force, fs, between_samples="held"), 5)
    apart = max(
        float(np.abs(found[kind][:, 0] - judge).max() / np.abs(judge).max())
        for kind, judge in zip(kinds, judges, strict=True)
    )
    how = "one `lfilter`: x alone" if outputs == 1 else "three `lfilter`: x, ẋ, ẍ"
    row(f"held force, {samples:,} samples ({how})", (slow, apart), (fast, apart))


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
    """Output error on spectra, each line weighted by the scatter of the periods.

    SciPy uses `least_squares` of the same residuals, scaled, with initial values that are wrong by
    a tenth, and standard errors from its Jacobian. `identify` also finds its initial values and
    makes all checks of the data and of the residual.
    """
    fs, period = 128.0, 256
    truth = np.array([25.0, 188.5, 142_122.0])
    drive = mechid.multisine(period, fs, lines="4:60", amplitude=2.0)
    exact = mechid.integrate(MACHINE, drive.force, fs, scheme="exact", response="periodic")
    force, motion = np.tile(drive.force, periods), np.tile(exact["displacement"][:, 0], periods)
    motion += np.random.default_rng(4).normal(0.0, 0.01 * motion.std(), len(motion))
    lines = np.array(drive.lines)
    omega = 2 * np.pi * lines * fs / period

    def theirs() -> tuple[np.ndarray, np.ndarray]:
        f, x = (np.fft.rfft(v.reshape(periods, period), axis=1)[:, lines] for v in (force, motion))
        scatter = np.sqrt((np.abs(x - x.mean(axis=0)) ** 2).sum(axis=0) / (periods - 1) / periods)
        f, x = f.mean(axis=0), x.mean(axis=0)

        def residual(scaled: np.ndarray) -> np.ndarray:
            m, c, k = scaled * truth
            apart = (x - f / (k - omega**2 * m + 1j * omega * c)) / scatter
            return np.concatenate([apart.real, apart.imag])

        found = optimize.least_squares(residual, np.full(3, 1.1), xtol=1e-12, ftol=1e-12, gtol=1e-12)
        covariance = np.linalg.inv(found.jac.T @ found.jac) / 2
        return np.asarray(found.x * truth), np.sqrt(np.diag(covariance)) * truth

    def ours() -> tuple[np.ndarray, np.ndarray]:
        found = mechid.identify(force, motion, fs=fs, period=period, method="maximum-likelihood")
        rows = [found.parameters[name] for name in ("m", "c", "k")]
        return np.array([p.value for p in rows]), np.array([p.std_error or 0.0 for p in rows])

    slow, (judge, error) = timed(theirs, 10)
    fast, (found, _) = timed(ours, 10)
    # Both find the same minimum, to a hundredth of a standard error.
    assert (np.abs(found - judge) < 0.01 * error).all()
    errors = [float(np.abs(values / truth - 1).max()) for values in (judge, found)]
    row(f"output error, {periods} periods of {period} (`least_squares`); with start and checks",
        (slow, errors[0]), (fast, errors[1]))


def main() -> None:
    print("| Task | SciPy | mechid | ratio | error, SciPy | error, mechid |")
    print("|---|---|---|---|---|---|")
    stepping(MACHINE, "linear force, 100,000 samples (`lsim`)", 100_000)
    stepping(TWO, "the same, two degrees of freedom", 100_000)
    filtering(1_000_000, 3)
    filtering(1_000_000, 1)
    responses(262_144, 1024)
    fitting(8)
    fitting(1024)


if __name__ == "__main__":
    main()

"""Time that the package needs in addition to the computation: prints a table.

Times of calls are the shortest of many repetitions. Times of processes are the shortest of several,
as ratios to a process that only imports NumPy.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np

import mechid
from mechid import _mechid

MACHINE = mechid.Machine(25.0, 188.5, 142_122.0)


def least(work: Callable[[], object], repeats: int) -> float:
    """Return the shortest time of a call, in s."""
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - begin)
    return float(best)


def process(words: Sequence[str], repeats: int = 15) -> float:
    """Return the shortest time of a process, in s."""
    return least(lambda: subprocess.run(words, check=True, capture_output=True), repeats)


def call() -> None:
    """Measure a call of 1,024 × 2 samples: the time in the compiled module and the time around
    it."""
    force, x = np.random.default_rng(5).standard_normal((2, 1024))
    record = mechid.Measurement.from_arrays(force, x, fs=128.0)
    told = json.dumps(mechid.identify(record, period=512, method="least-squares").settings)
    inner = record.window(period=512)._inner

    whole = least(
        lambda: mechid.identify(force, x, fs=128.0, period=512, method="least-squares"), 1000
    )
    work = least(lambda: _mechid.identify([inner], told, None, None), 1000)
    copy = least(lambda: mechid.Measurement.from_arrays(force, x, fs=128.0), 5000)
    hop = least(lambda: record.force, 5000)
    lines = json.dumps({"method": "least-squares", "lines": "999"})
    with_keywords = least(
        lambda: refused(lambda: mechid.identify(record, lines="999", method="least-squares")), 5000
    )
    around = with_keywords - least(
        lambda: refused(lambda: _mechid.identify([record._inner], lines, None, None)), 5000
    )
    print("| Call of 1,024 × 2 samples | µs |")
    print("|---|---|")
    print(f"| `identify` by least squares | {1e6 * whole:.0f} |")
    print(f"| of that, the compiled `identify` | {1e6 * work:.0f} |")
    print(f"| arrays checked and copied in | {1e6 * copy:.1f} |")
    print(f"| keywords to settings | {1e6 * around:.1f} |")
    print(f"| to a thread of the pool and back, with 1,024 samples out | {1e6 * hop:.1f} |")
    print(f"| the last three: beyond the work | {1e6 * (copy + around + hop):.1f} |")


def refused(call: Callable[[], object]) -> None:
    """Fail at once: there is no such line."""
    try:
        call()
    except mechid.MechidError:
        return
    raise AssertionError("it succeeded")


def work(_: int) -> float:
    """Compute for some ten milliseconds on one thread."""
    force = np.random.default_rng(6).standard_normal(100_000)
    moved = mechid.predict(MACHINE, force, 128.0)
    found = mechid.identify(
        force, moved["displacement"], velocity=moved["velocity"], fs=128.0, domain="time", threads=1
    )
    return found.parameters["k"].value


def threads() -> None:
    """Compare two threads with one, and two processes, which share no lock, with one."""

    def by(pool: Executor) -> float:
        with pool:
            return least(lambda: list(pool.map(work, range(16))), 8)

    one, two = by(ThreadPoolExecutor(1)), by(ThreadPoolExecutor(2))
    alone, apart = by(ProcessPoolExecutor(1)), by(ProcessPoolExecutor(2))
    print(f"\nTwo threads are {one / two:.2f} × as fast as one, two processes {alone / apart:.2f} ×.")


def starts() -> None:
    """Measure the time to import the package and to start the program."""
    numpy = process([sys.executable, "-c", "import numpy"])
    bare = process([sys.executable, "-c", "pass"])
    both = process([sys.executable, "-c", "import mechid; mechid.identify"])
    alone = process([sys.executable, "-c", "import mechid"])
    program = shutil.which("mechid", path=str(Path(sys.executable).parent))
    print("\n| Process | ms | to `import numpy` |")
    print("|---|---|---|")
    rows = [("`python -c pass`", bare), ("`import numpy`", numpy), ("`import mechid`", alone),
            ("`import mechid; mechid.identify`", both)]
    if program is not None:
        rows.append(("`mechid --version`", process([program, "--version"])))
    for name, seconds in rows:
        print(f"| {name} | {1e3 * seconds:.0f} | {seconds / numpy:.2f} |")


if __name__ == "__main__":
    call()
    threads()
    starts()

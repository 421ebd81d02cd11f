"""What the package costs beyond its work: prints a table.

Times of the call are least times of many; those of processes are least times of several, as ratios to
a process that imports NumPy alone.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

import mechid


def least(work: Callable[[], object], repeats: int) -> float:
    """Least time of a call, in s."""
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - begin)
    return float(best)


def process(words: Sequence[str], repeats: int = 15) -> float:
    """Least time of a process, in s."""
    return least(lambda: subprocess.run(words, check=True, capture_output=True), repeats)


def call() -> None:
    """A call of 1,024 × 2 samples: all of it, and beyond the work in Rust."""
    force, x = np.random.default_rng(5).standard_normal((2, 1024))
    record = mechid.Measurement.from_arrays(force, x, fs=128.0)

    def refused() -> None:
        # Goes to the other thread and back, for the fit refuses at once.
        try:
            mechid.identify(force, x, fs=128.0, lines="2000")
        except mechid.MechidError:
            pass

    copy = least(lambda: mechid.Measurement.from_arrays(force, x, fs=128.0), 5000)
    beyond = least(refused, 5000)
    frf = least(lambda: mechid.frf(record, segment=128), 2000)
    fit = least(lambda: mechid.identify(force, x, fs=128.0, period=512), 500)
    print("| 1,024 × 2 samples | µs |")
    print("|---|---|")
    print(f"| copied in | {1e6 * copy:.0f} |")
    print(f"| copied in, to the other thread and back, a failure told: the call without work | {1e6 * beyond:.0f} |")
    print(f"| `frf` of a `Measurement` | {1e6 * frf:.0f} |")
    print(f"| `identify` of arrays | {1e6 * fit:.0f} |")


def threads() -> None:
    """Two threads against one, each call in a thread of its own."""
    force = np.random.default_rng(6).standard_normal(100_000)
    moved = mechid.predict(mechid.Machine(25.0, 188.5, 142_122.0), force, 128.0)
    record = mechid.Measurement.from_arrays(
        force, moved["displacement"], velocity=moved["velocity"], fs=128.0
    )

    def work(_: int) -> None:
        mechid.identify(record, domain="time", threads=1)

    def by(workers: int) -> float:
        with ThreadPoolExecutor(workers) as pool:
            return least(lambda: list(pool.map(work, range(8))), 5)

    one, two = by(1), by(2)
    print(f"\nTwo threads are {one / two:.2f} × as fast as one.")


def starts() -> None:
    """Time to import and to start the program."""
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

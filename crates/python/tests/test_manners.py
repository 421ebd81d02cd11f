"""Behaviour of the package: locks, threads, processes, Ctrl-C, and its starting time."""

from __future__ import annotations

import html
import multiprocessing
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import mechid

from .conftest import ROOT

FILE = "examples/machine.csv"
# A long call that needs little memory. If the tests run in the background, Ctrl-C is ignored, and Python inherits this.
LONG = """
import signal
import mechid
signal.signal(signal.SIGINT, signal.default_int_handler)
print("ready", flush=True)
mechid.sweep("examples/machine.json", npi=[1 + k / 10_000 for k in range(90_000)])
"""


def stiffness() -> float:
    found = mechid.identify(FILE, force="force", displacement="displacement", period=256)
    return found.parameters["k"].value


def test_threads_work_side_by_side() -> None:
    with ThreadPoolExecutor(8) as pool:
        assert set(pool.map(lambda _: stiffness(), range(64))) == {stiffness()}


def test_the_lock_is_released_during_the_work() -> None:
    rng = np.random.default_rng(1)
    f, x, v = rng.standard_normal((3, 200_000))
    ticks, done = 0, threading.Event()

    def work() -> None:
        mechid.identify(f, x, velocity=v, fs=1000.0, domain="time", between_samples="euler",
                        refine="20:spline")
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.wait(0.001):
        ticks += 1
    thread.join()
    assert ticks > 20


@pytest.mark.parametrize("method", ["fork", "spawn"])
@pytest.mark.filterwarnings("ignore:.*use of fork:DeprecationWarning")
def test_children_work_as_the_parent_does(method: str) -> None:
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"{method} is not a way to start processes here")
    # A forked child does not have the threads of its parent.
    here = stiffness()
    with multiprocessing.get_context(method).Pool(2) as pool:
        found = [pool.apply_async(stiffness).get(timeout=60) for _ in range(4)]
    assert set(found) == {here}


@pytest.mark.skipif(os.name != "posix", reason="signals are sent as POSIX has them")
def test_ctrl_c_ends_a_long_call() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", LONG], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        time.sleep(0.5)
        assert child.poll() is None, "the call is over before it can be interrupted"
        before = time.monotonic()
        child.send_signal(signal.SIGINT)
        _, told = child.communicate(timeout=30)
        assert "KeyboardInterrupt" in told
        assert time.monotonic() - before < 1.0 + 0.5, "half a second more for the interpreter to end"


def test_the_program_starts_without_numpy(program: Callable[..., str]) -> None:
    assert program("--version") == f"mechid {mechid.__version__}\n"
    told = subprocess.run(
        [sys.executable, "-c", "import sys, mechid, mechid._program; print('numpy' in sys.modules)"],
        capture_output=True, text=True, check=True,
    )
    assert told.stdout == "False\n"


def test_the_package_needs_numpy_alone() -> None:
    script = (
        "import sys, mechid; mechid.identify, mechid.Measurement\n"
        "print([name for name in ('scipy', 'pandas', 'xarray', 'matplotlib') if name in sys.modules])"
    )
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert told.stdout == "[]\n"


def test_the_program_fails_as_it_does_elsewhere(program: Callable[..., str]) -> None:
    assert program("identify", "missing.csv", code=2).startswith("error: ")
    told = subprocess.run([sys.executable, "-m", "mechid", "--version"], capture_output=True, text=True)
    assert told.stdout == program("--version")


def test_a_report_of_the_program_says_how_it_is_made_again(
    program: Callable[..., str], tmp_path: Path
) -> None:
    page = tmp_path / "rig.html"
    arguments = ["--force", "force", "--displacement", "displacement", "--period", "256"]
    program("report", FILE, *arguments, "--output", page)
    command = shlex.join(["mechid", "report", FILE, *arguments, "--output", str(page)])
    assert html.escape(command, quote=False) in page.read_text(encoding="utf-8")

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


def test_a_time_limit_ends_only_its_own_call() -> None:
    def text(limit: float | None) -> str:
        found = mechid.identify(FILE, force="force", displacement="displacement", time_limit=limit)
        return found.to_json()

    whole, limited = text(None), text(0.0)
    assert "the time limit of 0 s ended the work early" in limited
    assert text(1e6) == whole
    limits = [None, 0.0] * 8
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(text, limits)) == [whole, limited] * 8


def test_a_time_limit_without_a_result_is_named() -> None:
    with pytest.raises(mechid.MechidError) as raised:
        mechid.decay("examples/decay.csv", acceleration=["a1", "a2", "a3"], time_limit=0.0)
    assert raised.value.code == "analysis.time-limit"
    assert raised.value.fields["seconds"] == 0.0
    with pytest.raises(mechid.MechidError, match="`time_limit`"):
        mechid.identify(FILE, force="force", displacement="displacement", time_limit=-1.0)


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


def code_or_stiffness(file: str) -> str | float:
    try:
        found = mechid.identify(file, force="force", displacement="displacement", period=256)
    except mechid.MechidError as error:
        return error.code
    return found.parameters["k"].value


@pytest.mark.parametrize("method", ["fork", "spawn"])
@pytest.mark.filterwarnings("ignore:.*use of fork:DeprecationWarning")
def test_a_damaged_record_does_not_stop_a_pool(method: str, tmp_path: Path) -> None:
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"{method} is not a way to start processes here")
    mechid.identify(FILE, force="force", displacement="displacement", period=256)
    damaged = {"empty.csv": b"", "bytes.mat": b"MATLAB 5.0 MAT-file" + bytes(300), "short.csv": b"time,force\n0,1\n"}
    for name, content in damaged.items():
        (tmp_path / name).write_bytes(content)
    files = [FILE, *(str(tmp_path / name) for name in damaged), FILE]
    with multiprocessing.get_context(method).Pool(2) as pool:
        found = pool.map_async(code_or_stiffness, files, chunksize=1).get(timeout=60)
        # A failure reaches the parent as itself.
        failure = pool.apply_async(mechid.identify, [files[1]], {"force": "f", "displacement": "x"})
        with pytest.raises(mechid.MechidError) as raised:
            failure.get(timeout=60)
    assert found[0] == found[-1] == stiffness()
    codes = [code for code in found[1:-1] if isinstance(code, str)]
    assert len(codes) == len(damaged) and all(code.startswith("io.") for code in codes), codes
    assert raised.value.code == found[1]


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

"""Fixtures of several tests: the example record, and the program that belongs to the package."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def in_the_repository(monkeypatch: pytest.MonkeyPatch) -> None:
    """Use the folder to which the paths in the pages refer."""
    monkeypatch.chdir(ROOT)


@pytest.fixture(scope="session")
def program() -> Callable[..., str]:
    """The installed program: returns its output for some arguments."""
    found = shutil.which("mechid", path=os.path.dirname(sys.executable))
    assert found is not None, "the wheel brings no program"

    def run(*arguments: object, code: int = 0) -> str:
        words = [found, *(str(argument) for argument in arguments)]
        ended = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
        assert ended.returncode == code, ended.stderr
        return ended.stdout if code == 0 else ended.stderr

    return run


@pytest.fixture(scope="session")
def columns() -> dict[str, np.ndarray]:
    """The example record as arrays: time, force, displacement, velocity, acceleration."""
    path = ROOT / "examples/machine.csv"
    with path.open() as file:
        lines = [line for line in file if not line.startswith("#")]
    names = lines[0].strip().split(",")
    values = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    return dict(zip(names, values.T, strict=True))

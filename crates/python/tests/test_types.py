"""Types: the package and its examples under `mypy --strict`, and the stub of the compiled
module."""

from __future__ import annotations

import subprocess
import sys

from .conftest import ROOT


EXAMPLES = sorted(path.as_posix() for path in (ROOT / "crates/python/examples").glob("[0-9]*.py"))


def told(*arguments: str) -> str:
    ended = subprocess.run(
        [sys.executable, "-m", *arguments], cwd=ROOT / "crates/python", capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def test_the_package_is_typed_strictly() -> None:
    assert "no issues found" in told("mypy", "--strict", "python/mechid", *EXAMPLES)


def test_the_stub_is_the_compiled_module() -> None:
    assert "no issues found" in told("mypy.stubtest", "mechid._mechid")

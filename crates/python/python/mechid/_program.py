"""The program ``mechid``."""

from __future__ import annotations

import signal
import sys

from ._mechid import program


def main() -> int:
    """Run the program with the arguments of this process and return its exit code."""
    # Ctrl-C ends the program at once: Python does not check its flag while compiled code runs.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return program(["mechid", *sys.argv[1:]], sys.executable or None)

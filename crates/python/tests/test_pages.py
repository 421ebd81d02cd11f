"""The Python code of the README, the book and the docstrings is run, and its output compared."""

from __future__ import annotations

import doctest
import importlib
import re
from pathlib import Path

import pytest

import mechid

from .conftest import ROOT

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
PAGES = sorted(
    page.relative_to(ROOT).as_posix()
    for page in [ROOT / "README.md", *ROOT.glob("docs/**/*.md")]
    if "```python" in page.read_text(encoding="utf-8")
)


def run(test: doctest.DocTest) -> int:
    told: list[str] = []
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    runner.run(test, out=told.append)
    assert not runner.summarize(verbose=False).failed, "".join(told)
    return len(test.examples)


def test_there_are_pages() -> None:
    assert {"README.md", "docs/book/src/python.md"} <= set(PAGES)


@pytest.mark.parametrize("page", PAGES)
def test_pages_print_what_they_show(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    # Everything except the Python code becomes empty lines, so that line numbers do not change.
    kept, inside = [], False
    for line in text.splitlines():
        fence = re.match(r"```(\S*)", line)
        if fence:
            inside = not inside and fence.group(1) == "python"
            line = ""
        kept.append(line if inside else "")
    examples = doctest.DocTestParser().get_doctest("\n".join(kept), {}, page, page, 0)
    assert run(examples) > 0, "Python in a page is shown with its prompts"


@pytest.mark.parametrize("name", sorted(path.stem for path in Path(mechid.__path__[0]).glob("*.py")))
def test_docstrings_print_what_they_show(name: str) -> None:
    if name in ("__main__",):
        return
    module = importlib.import_module("mechid" if name == "__init__" else f"mechid.{name}")
    for test in doctest.DocTestFinder().find(module):
        run(test)

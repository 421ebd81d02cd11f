"""Codes of failures: the list in the book has every failure of the library.

``MECHID_BLESS=1 python -m pytest crates/python -k codes`` writes the page again. A code on the page
must never disappear, because programs identify failures by it.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from mechid._errors import MechidError, _kebab

from .conftest import ROOT

PAGE = ROOT / "docs/book/src/reference/codes.md"
HEAD = """# Codes of failures

`MechidError.code` identifies a failure: it is the part of the library, a dot, and the name of the failure. It is the same for every call that can fail so.
Codes never change, while messages may become clearer. `MechidError.fields` has the numbers and names of the message.

| Code | Failure |
|---|---|
| `settings` | A setting has no such value. |
| `threads` | The system gives no threads. |
| `internal` | A defect of the library. |
"""
ENUMS = re.compile(r"^pub enum (\w+)Error \{\n(.*?)^\}", re.MULTILINE | re.DOTALL)
VARIANTS = re.compile(
    r"(?P<about>(?:    ///[^\n]*\n)+)    #\[error\(\s*(?P<told>transparent|.*?)\s*\)\]\n    (?P<name>[A-Z]\w*)",
    re.DOTALL,
)


def failures() -> dict[str, str]:
    """Codes of all failures of the library with their descriptions, from its sources."""
    found: dict[str, str] = {}
    others = ["mechid/src/simulation", "modal/src/free_decay", "modal/src/ambient", "model/src/elements",
              "estimate/src/likelihood"]
    paths = [*ROOT.glob("crates/*/src/error.rs"), *(ROOT / f"crates/{at}/error.rs" for at in others)]
    for path in paths:
        for kind, body in ENUMS.findall(path.read_text(encoding="utf-8")):
            # The package calls no function with this failure.
            if kind in ("Bearing", "Cli", "Problem"):
                continue
            for variant in VARIANTS.finditer(body):
                if variant["told"] != "transparent":
                    code = f"{part(kind, variant['name'])}.{_kebab(variant['name'])}"
                    found[code] = summary(variant["about"])
    return found


def part(kind: str, name: str) -> str:
    """The part of the library that a code names; it does not change if a failure moves to another
    crate."""
    of_model = ("EntryNotFinite", "ExponentialOverflow", "NotConverged", "NotSquare")
    if kind == "Numerics" and name in of_model:
        return "model"
    if kind in ("Numerics", "Spectra", "FreeDecay") or (kind, name) == ("Signal", "TooShort"):
        return "estimate"
    return _kebab(kind)


def summary(docs: str) -> str:
    """The first paragraph of a doc comment, as a cell of a table."""
    lines = [line.strip().removeprefix("///").strip() for line in docs.splitlines()]
    return " ".join(lines[: lines.index("")] if "" in lines else lines).replace("|", "\\|")


def page() -> str:
    rows = [f"| `{code}` | {told} |" for code, told in sorted(failures().items())]
    return HEAD + "\n".join(rows) + "\n"


def listed() -> set[str]:
    return set(re.findall(r"^\| `([a-z.0-9-]+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE))


def test_the_list_is_every_failure_of_the_library() -> None:
    if os.environ.get("MECHID_BLESS"):
        PAGE.write_text(page(), encoding="utf-8")
    gone = listed() - set(failures()) - {"settings", "threads", "internal"}
    assert not gone, f"codes are stable, programs know them: {sorted(gone)}"
    assert PAGE.read_text(encoding="utf-8") == page(), "MECHID_BLESS=1 writes the page anew"


def test_every_enum_is_read() -> None:
    """Each variant has a message or passes another failure on, and the parser finds all of them."""
    for path in Path(ROOT).glob("crates/*/src/error.rs"):
        for _, body in ENUMS.findall(path.read_text(encoding="utf-8")):
            told = body.count("#[error(")
            assert len(list(VARIANTS.finditer(body))) == told > 0, path


@pytest.mark.parametrize(
    ("variant", "code"),
    [
        ("Analysis(Window { first: 1 })", "analysis.window"),
        ("Analysis(Estimate(Model(SingularMass { size: 2 })))", "model.singular-mass"),
        ("Model(SingularMass { size: 2 })", "model.singular-mass"),
        ("Report(Analysis(Unfit { error: TooFewRows { rows: 1 }, reasons: \"x\" }))", "analysis.unfit"),
        ("Simulate(Io(Model { file: \"a\", error: NoDof }))", "io.model"),
        ("Analysis(NoRecord)", "analysis.no-record"),
        ("Settings", "settings"),
    ],
)
def test_a_code_is_the_same_by_whatever_way_a_failure_comes(variant: str, code: str) -> None:
    assert MechidError("message", variant).code == code
    assert code in listed()

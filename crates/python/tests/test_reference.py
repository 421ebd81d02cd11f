"""The reference page of the book is written from the docstrings of the package.

``MECHID_BLESS=1 python -m pytest crates/python -k reference`` writes it again.
"""

from __future__ import annotations

import inspect
import os
from typing import Any

import mechid
from mechid import fleet, plotting
from mechid._results import Drawn, Plotted, Result, Shaped

from .conftest import ROOT

PAGE = ROOT / "docs/book/src/reference/python.md"
HEAD = """# The functions of the Python package

Written from the docstrings of the package; [The Python package](../python.md) introduces it.
"""


def told(thing: Any) -> str:
    return inspect.cleandoc(inspect.getdoc(thing) or "")


def signature(thing: Any) -> str:
    """Name and parameters; the docstring describes keywords that several functions have in
    common."""
    names = []
    for name, parameter in inspect.signature(thing).parameters.items():
        if name in ("self", "cls"):
            continue
        star = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
        default = "" if parameter.default is parameter.empty else f"={parameter.default!r}"
        if parameter.kind is parameter.KEYWORD_ONLY and not any(n.startswith("*") for n in names):
            names.append("*")
        names.append(f"{star}{name}{default}")
    return f"({', '.join(names)})"


def members(kind: type) -> list[str]:
    rows = []
    for name, thing in vars(kind).items():
        if name.startswith("_") or name in getattr(kind, "__dataclass_fields__", {}):
            continue
        if inspect.isdatadescriptor(thing) or hasattr(thing, "attrname"):
            about = told(thing).split("\n\n")[0].replace("\n", " ")
            if about and not isinstance(thing, type(type.__dict__["__dict__"])):
                rows.append(f"- `.{name}`: {about}")
        elif callable(getattr(kind, name)):
            about = told(getattr(kind, name)).split("\n\n")[0].replace("\n", " ")
            rows.append(f"- `.{name}{signature(getattr(kind, name))}`: {about}")
    return rows


def section(name: str, thing: Any) -> str:
    if isinstance(thing, type):
        rows = [] if issubclass(thing, Exception) else members(thing)
        listed = "\n".join(rows)
        return f"### `{name}`\n\n```text\n{told(thing)}\n```\n" + (f"\n{listed}\n" if rows else "")
    return f"### `{name}{signature(thing)}`\n\n```text\n{told(thing)}\n```\n"


def page() -> str:
    things = {name: getattr(mechid, name) for name in mechid.__all__ if name != "__version__"}
    functions = [section(n, t) for n, t in things.items() if not isinstance(t, type)]
    kinds = [section(n, t) for n, t in things.items() if isinstance(t, type)]
    shared = [section(kind.__name__, kind) for kind in (Result, Plotted, Drawn, Shaped)]
    drawn = [section(f"plotting.{name}", getattr(plotting, name)) for name in plotting.__all__]
    many = [section(f"fleet.{name}", getattr(fleet, name)) for name in fleet.__all__]
    parts = [HEAD, "## Functions\n", *functions, "## Records and results\n", *kinds,
             "## What results have in common\n", *shared, "## Plots\n", *drawn, "## Many records\n", *many]
    return "\n".join(parts)


def test_the_reference_is_what_the_docstrings_say() -> None:
    if os.environ.get("MECHID_BLESS"):
        PAGE.write_text(page(), encoding="utf-8")
    assert PAGE.read_text(encoding="utf-8") == page(), "MECHID_BLESS=1 writes the page anew"


def test_every_public_thing_is_told() -> None:
    for name in mechid.__all__:
        thing = getattr(mechid, name)
        if name != "__version__":
            assert told(thing), name
        if isinstance(thing, type):
            for member, value in vars(thing).items():
                if not member.startswith("_") and callable(getattr(thing, member)):
                    assert told(getattr(thing, member)), f"{name}.{member}"
            continue
        if callable(thing):
            assert "Raises\n------" in told(thing), name

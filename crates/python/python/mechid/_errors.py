"""The exception of every failure."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import cached_property, wraps
from typing import ParamSpec, TypeVar

from ._mapping import ReadOnly

_TOKEN = re.compile(
    r"""\s*(?:
        (?P<text>"(?:[^"\\]|\\.)*")
      | (?P<number>-?(?:\d[\d.]*(?:e-?\d+)?|inf)(?![\w.])|NaN\b)
      | (?P<name>[A-Za-z_]\w*)
      | (?P<mark>[{}()\[\],:])
    )""",
    re.VERBOSE,
)
_ESCAPE = re.compile(r"\\(?:u\{([0-9a-f]+)\}|(.))")
_ESCAPED = {"n": "\n", "t": "\t", "r": "\r", "0": "\0"}


class MechidError(ValueError):
    """A failure of an analysis, with the message of the program ``mechid``.

    Attributes
    ----------
    code : str
        Identifier of the failure for programs, such as ``"analysis.window"`` or
        ``"estimate.too-few-rows"``; it never changes. The reference of the book lists all
        identifiers.
    fields : mapping
        The numbers and names of the message, such as ``{"first": 1, "last": 600, "len": 512}``.
    """

    def __init__(self, message: str, variant: str = "Failure") -> None:
        # Settings in the message have the names of the keywords of this package.
        super().__init__(message.replace("`sample_rate`", "`fs`"))
        self._variant = variant

    @cached_property
    def _parts(self) -> tuple[list[str], dict[str, object]]:
        # The code is computed only on request: a caller that ignores it does not wait for it.
        return _read(self._variant)

    @property
    def code(self) -> str:
        """Identifier of the failure, such as ``"analysis.window"``."""
        # Intermediate layers only pass a failure on, so the code names the innermost one.
        return ".".join(_kebab(name) for name in self._parts[0][-2:])

    @property
    def fields(self) -> Mapping[str, object]:
        """Numbers and names of the message."""
        return ReadOnly(self._parts[1])

    def __reduce__(self) -> tuple[type[MechidError], tuple[str, str]]:
        return type(self), (str(self), self._variant)


_Given = ParamSpec("_Given")
_Answer = TypeVar("_Answer")


def careful(door: Callable[_Given, _Answer]) -> Callable[_Given, _Answer]:
    """Return a function that raises `MechidError` if a number or a text is outside the accepted
    range.

    The compiled module accepts non-negative integers, and text with a UTF-8 form; other values
    would raise an exception of the layer between Python and Rust.
    """

    @wraps(door)
    def call(*given: _Given.args, **named: _Given.kwargs) -> _Answer:
        threads = named.get("threads")
        # The compiled module takes a truth value as the number 0 or 1.
        if threads is not None and (type(threads).__name__ in ("bool", "bool_") or not hasattr(threads, "__index__")):
            raise TypeError(f"`threads` must be a whole number, got {threads!r}")
        try:
            return door(*given, **named)
        except OverflowError as error:
            message = f"a number is negative or too large: {error}"
            raise MechidError(message, "Settings") from None
        except UnicodeError as error:
            raise MechidError(f"a text cannot be encoded in UTF-8: {error}", "Settings") from None
        except RecursionError as error:
            raise MechidError(f"settings are nested too deep: {error}", "Settings") from None

    return call


def _kebab(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "-", name).lower()


def _read(variant: str) -> tuple[list[str], dict[str, object]]:
    """Return the variants from the outermost to the innermost, and the fields of the innermost."""
    tokens = [(m.lastgroup or "", m.group().strip()) for m in _TOKEN.finditer(variant)]
    try:
        value = _Reader(tokens).value()
    except (IndexError, ValueError):
        value = _Named(variant.split("(")[0].split("{")[0].strip(), {})
    names: list[str] = []
    while isinstance(value, _Named):
        names.append(value.name)
        inner = value.content
        if not (isinstance(inner, list) and len(inner) == 1 and isinstance(inner[0], _Named)):
            break
        value = inner[0]
    fields: dict[str, object] = {}
    if isinstance(value, _Named) and isinstance(value.content, dict):
        fields = {name: _plain(inner) for name, inner in value.content.items()}
    return names, fields


class _Named:
    """A variant or struct: its name, and its fields by name or in order."""

    def __init__(self, name: str, content: dict[str, object] | list[object]) -> None:
        self.name, self.content = name, content


def _plain(value: object) -> object:
    if isinstance(value, _Named):
        if value.name == "Some" and isinstance(value.content, list):
            return _plain(value.content[0])
        if not value.content:
            words: dict[str, object] = {"None": None, "true": True, "false": False}
            return words.get(value.name, _kebab(value.name))
        inner = value.content
        plain = _plain(inner)
        return {_kebab(value.name): plain}
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    return value


class _Reader:
    """Reader of the text that Rust's derived `Debug` writes."""

    def __init__(self, tokens: list[tuple[str, str]]) -> None:
        self._tokens, self._at = tokens, 0

    def value(self) -> object:
        kind, text = self._next()
        if kind == "text":
            return _ESCAPE.sub(_unescaped, text[1:-1])
        if kind == "number":
            return int(text) if re.fullmatch(r"-?\d+", text) else float(text)
        if kind == "name":
            if self._peek() == "{":
                return _Named(text, self._fields())
            if self._peek() == "(":
                return _Named(text, self._items(")"))
            return _Named(text, {})
        if text in "[(":
            self._at -= 1
            return self._items("]" if text == "[" else ")")
        raise ValueError(text)

    def _next(self) -> tuple[str, str]:
        self._at += 1
        return self._tokens[self._at - 1]

    def _peek(self) -> str:
        return self._tokens[self._at][1] if self._at < len(self._tokens) else ""

    def _items(self, end: str) -> list[object]:
        self._next()
        items: list[object] = []
        while self._peek() != end:
            items.append(self.value())
            if self._peek() == ",":
                self._next()
        self._next()
        return items

    def _fields(self) -> dict[str, object]:
        self._next()
        fields: dict[str, object] = {}
        while self._peek() != "}":
            _, name = self._next()
            if self._next()[1] != ":":
                raise ValueError(name)
            fields[name] = self.value()
            if self._peek() == ",":
                self._next()
        self._next()
        return fields


def _unescaped(found: re.Match[str]) -> str:
    code, letter = found.groups()
    return chr(int(code, 16)) if code else _ESCAPED.get(letter, letter)

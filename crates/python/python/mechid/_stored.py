"""Results in pickled form: the answers and arrays of a compiled result."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NoReturn

from ._errors import MechidError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

# Methods without arguments and properties of the compiled results, by their names.
_ANSWERS = (
    "to_json",
    "text",
    "compared",
    "covariance",
    "force",
    "receptances",
    "responses",
    "spectra",
    "spectrum",
    "std_error",
    "name",
    "is_exact",
    "mass",
    "damping",
    "stiffness",
    "modal",
    "state_matrices",
)


# Level of the intervals that are stored, the default of `Parameter.interval`.
_LEVEL = 0.95


class Stored:
    """Answers of a compiled result at the time at which it was pickled."""

    def __init__(self, answers: Mapping[str, tuple[bool, Any]]) -> None:
        self._answers = dict(answers)

    def interval(self, name: str, level: float) -> list[float]:
        """Return the interval of a parameter at the level at which it was stored."""
        _, intervals = self._answers.get("intervals", (False, {}))
        if level != _LEVEL or name not in intervals:
            _refuse("interval")
        bounds: list[float] = intervals[name]
        return bounds

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        known = self._answers.get(name)
        if known is None:
            return lambda *_args: _refuse(name)
        is_method, value = known
        return (lambda *_args: value) if is_method else value


def _refuse(name: str) -> NoReturn:
    raise MechidError(
        f"this result was pickled, and keeps only its numbers: call `{name}` before pickling",
        "Python(Pickled {})",
    )


def stored_intervals(inner: Any, names: Iterable[str]) -> Stored:
    """Return the intervals of some parameters of a result, without those that have none."""
    intervals: dict[str, list[float]] = {}
    for name in names:
        with suppress(MechidError):
            intervals[name] = inner.interval(name, _LEVEL)
    return Stored({"intervals": (False, intervals)})


def stored(held: Mapping[str, Any]) -> dict[str, Any]:
    """Return the contents of a result, with its answers instead of the compiled result."""
    # Public attributes were computed from the others, and are computed again.
    kept = {name: value for name, value in held.items() if name.startswith("_") and name != "_inner"}
    inner = held.get("_inner")
    if isinstance(inner, Stored):
        kept["_inner"] = inner._answers
    elif inner is not None:
        answers: dict[str, tuple[bool, Any]] = {}
        for name in _ANSWERS:
            value = getattr(inner, name, None)
            if value is None:
                continue
            try:
                answers[name] = (True, value()) if callable(value) else (False, value)
            except (MechidError, TypeError):
                # A method that needs arguments is not stored.
                continue
        if hasattr(inner, "interval"):
            names = [row["name"] for row in json.loads(inner.to_json())["parameters"]]
            answers |= stored_intervals(inner, names)._answers
        kept["_inner"] = answers
    return kept


def restored(kind: type[Any], kept: Mapping[str, Any]) -> Any:
    """Return a result that was pickled."""
    result: Any = object.__new__(kind)
    result.__dict__.update({name: value for name, value in kept.items() if name != "_inner"})
    if "_inner" in kept:
        result.__dict__["_inner"] = Stored(kept["_inner"])
    return result

"""Results in pickled form: the answers and arrays of a compiled result."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NoReturn

from ._errors import MechidError

if TYPE_CHECKING:
    from collections.abc import Mapping

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


class Stored:
    """Answers of a compiled result at the time at which it was pickled."""

    def __init__(self, answers: Mapping[str, tuple[bool, Any]]) -> None:
        self._answers = dict(answers)

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
        f"this result was pickled, which keeps only its numbers: call `{name}` before pickling",
        "Python(Pickled {})",
    )


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
        kept["_inner"] = answers
    return kept


def restored(kind: type[Any], kept: Mapping[str, Any]) -> Any:
    """Return a result that was pickled."""
    result: Any = object.__new__(kind)
    result.__dict__.update({name: value for name, value in kept.items() if name != "_inner"})
    if "_inner" in kept:
        result.__dict__["_inner"] = Stored(kept["_inner"])
    return result

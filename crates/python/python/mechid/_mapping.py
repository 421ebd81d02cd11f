"""The mappings of results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

_Key = TypeVar("_Key")
_Value = TypeVar("_Value")


class ReadOnly(Mapping[_Key, _Value]):
    """A mapping that cannot be changed and, unlike `types.MappingProxyType`, can be pickled."""

    __slots__ = ("_content",)

    def __init__(self, content: Mapping[_Key, _Value]) -> None:
        self._content = content

    def __getitem__(self, key: _Key) -> _Value:
        return self._content[key]

    def __iter__(self) -> Iterator[_Key]:
        return iter(self._content)

    def __len__(self) -> int:
        return len(self._content)

    def __or__(self, other: Mapping[_Key, _Value]) -> dict[_Key, _Value]:
        return {**self, **other}

    def __ror__(self, other: Mapping[_Key, _Value]) -> dict[_Key, _Value]:
        return {**other, **self}

    def copy(self) -> dict[_Key, _Value]:
        """Return a dictionary with the same contents."""
        return dict(self._content)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return type(self), (self.copy(),)

    def __repr__(self) -> str:
        return repr(self._content)

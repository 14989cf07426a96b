"""Rows that other packages offer as entry points, which are read when a name is looked up that no row has."""

from collections.abc import Callable
from importlib import metadata
from typing import Any, TypeVar

from cspr_jax.errors import ConfigError

Row = TypeVar("Row")


class ExtensibleRows(dict[str, Row]):
    """Rows by name, to which rows of installed packages are added when they are needed."""

    def __init__(self, rows: dict[str, Row], group: str, add: Callable[[Any], None]) -> None:
        """Keep the group of entry points, and the function that adds the object of an entry point."""
        super().__init__(rows)
        self._group, self._add, self._is_complete = group, add, False

    def __contains__(self, name: object) -> bool:
        if super().__contains__(name):
            return True
        self.complete()
        return super().__contains__(name)

    def __missing__(self, name: str) -> Row:
        if name in self:
            return self[name]
        raise KeyError(name)

    def complete(self) -> None:
        """Add the rows of installed packages, unless they have been added."""
        if self._is_complete:
            return
        errors = []
        for entry in metadata.entry_points(group=self._group):
            try:
                self._add(entry.load())
            except Exception as error:  # noqa: BLE001 - code of other packages may raise anything
                package = entry.dist.name if entry.dist else "unknown"
                words = f"{entry.name} = {entry.value}: cannot be used: {type(error).__name__}: {error}"
                errors.append(ConfigError(f"package {package}, entry points {self._group}", words))
        if errors:
            raise errors[0]
        self._is_complete = True

"""Estimators, antennas and radios from other packages, found by their entry points.

A package lists its objects in its own ``pyproject.toml``::

    [project.entry-points."uavrt.antennas"]
    "my-yagi" = "my_package:YAGI"

Nothing is imported until a name from another package, or the list of names, is requested.
"""

from collections.abc import Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from uavrt.core.errors import ConfigError

T = TypeVar("T")


class Registry(Mapping[str, T], Generic[T]):
    """Mapping of names to objects: those of uavrt and those of installed packages.

    `group`: group of entry points. `own`: uavrt's objects, whose names other packages cannot
    use. `kind`: required type of objects from other packages; None: any callable.
    """

    def __init__(self, group: str, own: Mapping[str, T], kind: type[T] | None = None) -> None:
        self.group = group
        self._own = dict(own)
        self._kind = kind
        self._loaded: dict[str, T] = {}
        self._added: dict[str, EntryPoint] | None = None

    def __getitem__(self, name: str) -> T:
        if name in self._own:
            return self._own[name]
        if name not in self._loaded:
            self._loaded[name] = self._load(self._additions()[name])
        return self._loaded[name]

    def add(self, name: str, thing: T) -> None:
        """Register an object under a name, for the lifetime of this process.

        Raises
        ------
        ConfigError
            The name is one of uavrt's own.
        """
        if name in self._own:
            raise ConfigError(f"{name!r} is reserved by uavrt", remedy="Choose another name")
        self._loaded[name] = thing

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in self._loaded or name in self._additions()

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys([*self._own, *self._additions(), *self._loaded]))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def _additions(self) -> dict[str, EntryPoint]:
        if self._added is None:
            found = sorted(entry_points(group=self.group), key=lambda one: one.name)
            self._added = {one.name: one for one in found if one.name not in self._own}
        return self._added

    def _load(self, entry: EntryPoint) -> T:
        package = entry.dist.name if entry.dist is not None else entry.value
        try:
            loaded = entry.load()
        except Exception as error:
            raise ConfigError(
                f"{entry.name!r} of the package {package} cannot be loaded: {error}",
                remedy=f"Fix or remove it: pip uninstall {package}",
            ) from error
        good = callable(loaded) if self._kind is None else isinstance(loaded, self._kind)
        if not good:
            wanted = "a function" if self._kind is None else f"of type {self._kind.__name__}"
            raise ConfigError(
                f"{entry.name!r} of the package {package} is not {wanted}",
                remedy=f"See {self.group} in docs/how-to/extend.md",
            )
        made: T = loaded
        return made

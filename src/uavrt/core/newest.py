"""A dictionary of limited size, for data from peers and for requests without an answer yet."""

from collections import OrderedDict
from typing import Generic, TypeVar

K = TypeVar("K")
V = TypeVar("V")


class Newest(OrderedDict[K, V], Generic[K, V]):
    """A dictionary of at most `most` entries; a new key replaces the entry set longest ago."""

    def __init__(self, most: int) -> None:
        self.most = most
        super().__init__()

    def __setitem__(self, key: K, value: V) -> None:
        super().__setitem__(key, value)
        self.move_to_end(key)
        if len(self) > self.most:
            self.popitem(last=False)

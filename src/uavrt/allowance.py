"""Rate limits for requests of unknown senders."""

from dataclasses import dataclass, field


@dataclass(slots=True, kw_only=True)
class Allowance:
    """A bucket of tokens: `burst` at once, then `per_s` each second."""

    burst: float
    per_s: float
    _left: float = field(init=False)
    _at_ns: int | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self._left = self.burst

    def take(self, now_ns: int, tokens: float = 1.0) -> bool:
        """Take `tokens` at a rising time [ns]; False, taking none, if fewer are left."""
        if self._at_ns is not None:
            earned = (now_ns - self._at_ns) * 1e-9 * self.per_s
            self._left = min(self.burst, self._left + earned)
        self._at_ns = now_ns
        if self._left < tokens:
            return False
        self._left -= tokens
        return True

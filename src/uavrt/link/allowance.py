"""Rate limits for requests, as token buckets."""

from dataclasses import dataclass, field


@dataclass(slots=True, kw_only=True)
class Allowance:
    """A token bucket: at most `burst` requests at once, refilled with `per_s` a second."""

    burst: float
    per_s: float
    _left: float = field(init=False)
    _at_ns: int | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self._left = self.burst

    def take(self, now_ns: int, tokens: float = 1.0) -> bool:
        """Take `tokens` from the bucket; False, without taking any, if it holds fewer.

        `now_ns`: time, which must not decrease from call to call.
        """
        if self._at_ns is not None:
            earned = (now_ns - self._at_ns) * 1e-9 * self.per_s
            self._left = min(self.burst, self._left + earned)
        self._at_ns = now_ns
        if self._left < tokens:
            return False
        self._left -= tokens
        return True

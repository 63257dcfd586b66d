"""Files of others are read or refused with a sentence, within the limits.

This is the short form of a campaign: ``python tests/drivers/foreign_files.py --files 2400``.
"""

import pytest
from foreign_files import FORMATS, Format, run


@pytest.mark.parametrize("one", FORMATS, ids=lambda one: one.name)
def test_each_format_is_read_or_refused_within_its_limits(one: Format) -> None:
    count, faults = run([one], 6, seed=4, say=lambda _line: None)
    assert count == 6
    assert faults == []


def test_the_campaign_sees_what_is_wrong() -> None:
    """A reader without limits fails it: it is no test that cannot fail."""

    def greedy(path: object) -> object:
        return bytearray(400_000_000)

    def broken(path: object) -> object:
        raise ZeroDivisionError

    for read, says in ((greedy, "MB"), (broken, "ZeroDivisionError")):
        wrong = Format(name="a", honest=b"a", attacks={}, read=read)
        _, faults = run([wrong], 1, seed=1, say=lambda _line: None, warm=False)
        assert len(faults) == 1
        assert says in faults[0]

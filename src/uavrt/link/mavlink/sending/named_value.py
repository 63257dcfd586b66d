"""Name a tag's values that stock ground stations show and plot: NAMED_VALUE_FLOAT (251)."""

import string

NAME_BYTES = 10
DECIMAL_BELOW = 10 ** (NAME_BYTES - len("SNR_"))
_DIGITS = string.digits + string.ascii_uppercase


def value_name(kind: str, tag_id: int) -> str:
    """Name of a tag's value, such as ``SNR_2``; long ids are in base 36 (``SNRLFLS``).

    Ten bytes hold an id of six digits. A longer id is written in base 36 without the underscore
    (``SNRLFLS`` is tag 1 000 000).
    """
    if tag_id < DECIMAL_BELOW:
        return f"{kind}_{tag_id}"
    digits = ""
    while tag_id:
        tag_id, digit = divmod(tag_id, len(_DIGITS))
        digits = _DIGITS[digit] + digits
    return kind + digits

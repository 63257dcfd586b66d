"""Name a tag's NAMED_VALUE_FLOAT (251) messages, which QGroundControl plots."""

import string

NAME_BYTES = 10
DECIMAL_BELOW = 10 ** (NAME_BYTES - len("SNR_"))
_DIGITS = string.digits + string.ascii_uppercase


def value_name(kind: str, tag_id: int) -> str:
    """Return the name of a tag's value in at most ten bytes, such as ``SNR_2``.

    Ids of up to six digits are written in decimal. A longer id is written in base 36 without
    the underscore (``SNRLFLS`` is tag 1 000 000).
    """
    if tag_id < DECIMAL_BELOW:
        return f"{kind}_{tag_id}"
    digits = ""
    while tag_id:
        tag_id, digit = divmod(tag_id, len(_DIGITS))
        digits = _DIGITS[digit] + digits
    return kind + digits

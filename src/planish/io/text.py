"""Text of files: the encodings that programs write."""

from __future__ import annotations

_MARKS = (
    (b"\xff\xfe\0\0", "utf-32-le"),
    (b"\0\0\xfe\xff", "utf-32-be"),
    (b"\xff\xfe", "utf-16-le"),
    (b"\xfe\xff", "utf-16-be"),
)
"""Byte order marks; that of UTF-32 begins with that of UTF-16."""


def as_text(data: bytes) -> str:
    """Bytes of unmarked text: UTF-8, else Latin-1, in which every byte is a letter.

    Examples
    --------
    >>> as_text("Über".encode()), as_text("Über".encode("latin-1"))
    ('Über', 'Über')
    """
    data = as_utf8(data)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def as_utf8(data: bytes) -> bytes:
    """The same text in UTF-8 where its mark says that it is in UTF-16 or UTF-32, as Windows programs save it.

    Bytes without a mark, and text that is not what its mark says, come back as they are.

    Examples
    --------
    >>> as_utf8("v 0 0 0".encode("utf-16"))
    b'v 0 0 0'
    """
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            try:
                return data[len(mark) :].decode(encoding).encode()
            except UnicodeDecodeError:
                return data
    return data

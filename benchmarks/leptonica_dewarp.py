"""Leptonica's dewarping as a command, through the library that Tesseract brings along: PHOTO PAGE.png.

Leptonica (Debian: liblept5) has it in the library only. Called as its own documentation does: background made even,
both disparities from the text lines.
"""

import sys
from ctypes import CDLL, POINTER, byref, c_char_p, c_int, c_void_p
from ctypes.util import find_library

PNG = 3
ADAPTIVE, BOTH_DISPARITIES, CHECK_COLUMNS = 1, 1, 0


def main(photo: str, page: str) -> int:
    leptonica = CDLL(find_library("lept"))
    for name in ("pixRead", "pixConvertTo8"):
        getattr(leptonica, name).restype = c_void_p
    grey = leptonica.pixConvertTo8(c_void_p(leptonica.pixRead(c_char_p(photo.encode()))), c_int(0))
    flat, models = c_void_p(), c_void_p()
    leptonica.dewarpSinglePage.argtypes = [c_void_p, *[c_int] * 4, POINTER(c_void_p), POINTER(c_void_p), c_int]
    wrong = leptonica.dewarpSinglePage(
        grey, 128, ADAPTIVE, BOTH_DISPARITIES, CHECK_COLUMNS, byref(flat), byref(models), 0
    )
    if wrong or not flat.value or not models.value:
        return 1
    return int(leptonica.pixWrite(c_char_p(page.encode()), flat, c_int(PNG)))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

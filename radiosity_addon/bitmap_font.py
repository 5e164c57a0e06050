"""Text drawn into arrays: capitals, digits and signs of five by seven dots, for pictures that need no font."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT, STEP = 5, 7, 6

# Rows from the top, five bits each, the leftmost the highest.
_GLYPHS = {
    "A": "0E11111F111111", "B": "1E11111E11111E", "C": "0E11101010110E", "D": "1E11111111111E", "E": "1F10101E10101F",
    "F": "1F10101E101010", "G": "0E11101711110F", "H": "1111111F111111", "I": "0E04040404040E", "J": "0702020202120C",
    "K": "11121418141211", "L": "1010101010101F", "M": "111B1515111111", "N": "11111915131111", "O": "0E11111111110E",
    "P": "1E11111E101010", "Q": "0E11111115120D", "R": "1E11111E141211", "S": "0F10100E01011E", "T": "1F040404040404",
    "U": "1111111111110E", "V": "11111111110A04", "W": "11111115151B11", "X": "11110A040A1111", "Y": "11110A04040404",
    "Z": "1F01020408101F", "0": "0E11131519110E", "1": "040C040404040E", "2": "0E11010204081F", "3": "1F02040201110E",
    "4": "02060A121F0202", "5": "1F101E0101110E", "6": "0608101E11110E", "7": "1F010204080808", "8": "0E11110E11110E",
    "9": "0E11110F01020C", "%": "18190204081303", "+": "0004041F040400", "-": "0000001F000000", ".": "00000000000C0C",
    ",": "000000000C0408", ":": "000C0C000C0C00", "/": "00010204081000", "(": "02040808080402", ")": "08040202020408",
    "=": "00001F001F0000", "_": "0000000000001F", "'": "04040800000000", "*": "000A041F040A00", " ": "00000000000000",
    "<": "02040810080402", ">": "08040201020408", "?": "0E110102040004", "#": "0A0A1F0A1F0A0A",
}


def text_mask(text: str, scale: int = 1) -> NDArray[np.bool_]:
    """(7 scale, 6 scale len(text)) bool, row 0 on top; small letters are drawn as capitals, unknown signs as "?"."""
    glyphs = [_glyph(letter) for letter in text.upper()]
    line = np.concatenate(glyphs, axis=1) if glyphs else np.zeros((HEIGHT, 0), bool)
    return np.asarray(np.repeat(np.repeat(line, scale, axis=0), scale, axis=1))


def text_size(text: str, scale: int = 1) -> tuple[int, int]:
    """Width and height of a text, pixels."""
    return STEP * scale * len(text), HEIGHT * scale


def draw_text(picture: NDArray[Any], text: str, x: int, y: int, colour: tuple[int, int, int], scale: int = 1) -> None:
    """Draw into (height, width, 3) uint8, the text's upper left corner at (x, y) from the top; cut off outside."""
    mask = text_mask(text, scale)
    rows, columns = np.nonzero(mask)
    rows, columns = rows + y, columns + x
    inside = (rows >= 0) & (rows < picture.shape[0]) & (columns >= 0) & (columns < picture.shape[1])
    picture[rows[inside], columns[inside]] = colour


def _glyph(letter: str) -> NDArray[np.bool_]:
    rows = bytes.fromhex(_GLYPHS.get(letter, _GLYPHS["?"]))
    dots = np.zeros((HEIGHT, STEP), bool)
    for row, bits in enumerate(rows):
        dots[row, :WIDTH] = [(bits >> (WIDTH - 1 - column)) & 1 for column in range(WIDTH)]
    return dots

"""The picture of the panel in README.md: `panel_picture.py SHOT.png PICTURE.png`.

The shot is out/gui/live-3-finer.png, which tests/gui/test_live_window.py takes of the whole screen; the viewport and
its sidebar are cut out of it and made smaller. In fewer colours the light would show bands.
"""

from __future__ import annotations

import sys

from PIL import Image

# Pixels of the shot: left, upper, right and lower edge of the viewport, and the width of the picture.
VIEWPORT, WIDTH = (0, 30, 1155, 1290), 720


def main(shot: str, picture: str) -> None:
    """Cut, shrink, and write."""
    whole = Image.open(shot).convert("RGB").crop(VIEWPORT)
    small = whole.resize((WIDTH, round(whole.height * WIDTH / whole.width)), Image.Resampling.LANCZOS)
    small.save(picture, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])

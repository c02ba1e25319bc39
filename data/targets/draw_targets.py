"""Draw the two targets of the shipped scenes: white is figure, black is ground.

The paper names its targets ("Diver", "Double Slit") and does not print their shapes, so these are
our own drawings: ``python data/targets/draw_targets.py`` writes them beside this file.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from skimage.draw import disk, polygon
from skimage.io import imsave

SIDE = 1000  # pixels over the 5 cm of the target: 0.05 mm each


def double_slit() -> np.ndarray:
    """Two upright bars; the right one is shorter, so that no rotation maps the picture on itself."""
    picture = np.zeros((SIDE, SIDE), dtype=np.uint8)
    picture[180:820, 330:430] = 255
    picture[180:740, 570:670] = 255
    return picture


def diver() -> np.ndarray:
    """A swimming diver seen from the side: head, tank, body, arms and fins."""
    picture = np.zeros((SIDE, SIDE), dtype=np.uint8)
    shapes = [
        [(430, 300), (400, 560), (500, 600), (540, 310)],  # body
        [(360, 330), (340, 520), (395, 530), (410, 335)],  # tank
        [(400, 560), (430, 740), (470, 745), (470, 590)],  # upper leg
        [(460, 580), (560, 730), (600, 715), (510, 570)],  # lower leg
        [(420, 735), (340, 890), (400, 905), (475, 742)],  # upper fin
        [(555, 725), (640, 880), (700, 850), (602, 712)],  # lower fin
        [(500, 340), (680, 260), (700, 300), (530, 400)],  # arm forward
        [(670, 255), (730, 200), (760, 230), (705, 305)],  # hand
        [(430, 210), (470, 160), (500, 180), (470, 240)],  # mask and mouthpiece
    ]
    for corners in shapes:
        rows, columns = zip(*corners, strict=True)
        picture[polygon(rows, columns, picture.shape)] = 255
    picture[disk((450, 260), 72, shape=picture.shape)] = 255
    return picture


if __name__ == "__main__":
    here = Path(__file__).parent
    for draw in (double_slit, diver):
        imsave(here / f"{draw.__name__}.png", draw(), check_contrast=False)

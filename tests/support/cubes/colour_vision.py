"""Differences of colours in CIELAB, for normal vision and the three kinds of dichromacy.

The matrices are from Machado, Oliveira and Fernandes (2009), doi:10.1109/TVCG.2009.113, at severity 1, on linear
RGB; CIELAB (1976) has the white D65.
"""

import numpy as np
from matplotlib.colors import to_rgb

SEEN = {
    "normal": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
_WHITE = _XYZ.sum(axis=1)


def lab(colour, vision="normal"):
    """CIELAB coordinates of a colour as a reader sees it."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = _XYZ @ np.clip(SEEN[vision] @ linear, 0, 1) / _WHITE
    x, y, z = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz * (29 / 6) ** 2 / 3 + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def difference(one, other, vision="normal"):
    """Euclidean distance of two colours in CIELAB, as a reader sees them."""
    return float(np.linalg.norm(lab(one, vision) - lab(other, vision)))


def least_difference(one, other):
    """The difference for those readers who see the least."""
    return min(difference(one, other, vision) for vision in SEEN)

"""A polygon with rounded corners: straight legs, and at every corner a quintic that leaves it by a given distance.

A corner of turning angle th is cut d before and behind it by the Bezier curve with the points d, (1 - G) d and
(1 - 2 G) d from it on either side: evenly spaced, so that the curvature is zero at both ends and continuous. Halfway
it is off the corner by

    e = K d sin(th / 2),    K = (1 + 5 (1 - G) + 10 (1 - 2 G)) / 16,

and with G = 0.3 its peak curvature is 6 % above that of the arc with the same e, whose curvature jumps.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BPoly

from pipeline.common.arrays import Array
from pipeline.path.spline import ByLength

G = 0.3
K = (1 + 5 * (1 - G) + 10 * (1 - 2 * G)) / 16
STRAIGHT = 1e-6  # [rad]: a corner that turns by less is none
ALONG = np.linspace(0.0, 1.0, 6)[:, None]  # Bezier points of a straight leg


class Blended(ByLength):
    """Through the polygon of `points` (P, m) [m], at most `blend` [m] off its corners, by arc length.

    A cut takes no more than half of either leg: where that is too little for `blend`, the corner is kept closer
    (`closer`: their indices).
    """

    def __init__(self, points: Array, blend: float) -> None:
        legs = np.diff(points, axis=0)
        lengths = np.linalg.norm(legs, axis=1)
        ways = legs / lengths[:, None]
        cosine = np.einsum("im,im->i", ways[:-1], ways[1:])
        # Half the turning angle, by its sine: the cosine has no digits left for small ones.
        half = np.arctan2(np.linalg.norm(ways[1:] - ways[:-1], axis=1), np.sqrt(np.maximum(2 + 2 * cosine, 0.0)))
        room = np.minimum(lengths[:-1], lengths[1:]) / 2
        wanted = blend / (K * np.maximum(np.sin(half), 1e-300))
        cut = np.where(2 * half > STRAIGHT, np.minimum(wanted, room), 0.0)
        self.closer = tuple(int(i) + 1 for i in np.flatnonzero((2 * half > STRAIGHT) & (wanted > room)))
        left = np.concatenate([[0.0], cut])  # of each leg, at its start
        right = np.concatenate([cut, [0.0]])
        pieces, widths, corners = [], [], [0.0]
        for i, way in enumerate(ways):
            straight = lengths[i] - left[i] - right[i]
            if straight > 1e-12 * lengths[i]:
                pieces.append(points[i] + (left[i] + ALONG * straight) * way)
                widths.append(straight)
            if i == len(ways) - 1:
                corners.append(sum(widths))
            elif cut[i] > 0:
                away = (1 - G * np.arange(3))[:, None] * cut[i]
                pieces.append(np.vstack([points[i + 1] - away * way, points[i + 1] + away[::-1] * ways[i + 1]]))
                widths.append(5 * G * cut[i])  # the speed is 1 at both ends
                corners.append(sum(widths) - widths[-1] / 2)
            else:
                corners.append(sum(widths))
        breaks = np.concatenate([[0.0], np.cumsum(widths)])
        super().__init__(BPoly(np.stack(pieces, axis=1), breaks), np.array(corners), breaks)

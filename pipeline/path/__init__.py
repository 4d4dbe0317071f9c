"""Curves, orientations and timing laws. By name from here: the smooth curve, and the reader of way-points."""

from pipeline.path.spline import Spline
from pipeline.path.waypoints import read_waypoints

__all__ = ["Spline", "read_waypoints"]

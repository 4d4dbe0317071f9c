"""Stationary motions of an integral of first order: extremals, and the scan for those that meet both ends."""

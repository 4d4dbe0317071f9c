"""Selfmotion: optimal redundancy resolution for robot arms."""

"""Calibrations of the user's cameras: the MTF from charts, and the file of each camera."""

"""Measuring a camera: sensor constants from raw frames, and its MTF from a star or a slanted edge."""

"""Noise of real cameras: estimators on recordings, sensor constants, bounds behind codecs, tables and records."""

"""Traces that a camera's processing leaves in a picture: of mosaics, demosaicing, median filters and codecs."""

"""Datasets: sharp frames with labelled boxes, from renderings, photographs and recorded drives."""

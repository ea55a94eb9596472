"""Measurements on pictures that the project may not keep, and the small files that they leave for the report.

Made by hand, with ``camera-monitor record``. Pictures, kernels and weights are named by their SHA-256
(`pipeline.recording.provenance`), so that whoever has them can repeat the numbers; no picture is kept.
`pipeline.report` reads the files.
"""

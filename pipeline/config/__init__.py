"""Configuration: ``conf/`` (Hydra groups) is the source, ``params.yaml`` is compiled from it and checked.

`pipeline.config.schema` declares what may be set, in which unit and range, `pipeline.config.compose` compiles
and compares, and `pipeline.config.entry` is the decorator that gives a stage its two ways in: ``dvc repro`` and
``python -m pipeline.stages.NAME key=value --multirun``.
"""

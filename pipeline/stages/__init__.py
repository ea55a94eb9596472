"""One short file per stage of the DAG: read inputs, call the library, write outputs."""

CONTROL_USES = {
    "pipeline.blur": ["spectral"],
    "pipeline.noise": ["adaptive"],
    "pipeline.detection": ["control.detector"],
}
"""Of stages about control (see `pipeline.config.entry.stage`): the condition monitor's estimators, and the detector."""

"""The parts of the fused estimator: members, the gate that joins them, its training, its calibration to a camera."""

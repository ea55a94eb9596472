"""The parts of a calibration to one camera: samples, maps of logits, output layers, and how they are fitted."""

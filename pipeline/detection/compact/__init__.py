"""Compact detectors, small enough to be trained on two cores: one of one stage, one of two, on the same trunk."""

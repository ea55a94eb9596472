"""Experiments: frames under conditions, estimated by any estimators, compared with the ground truth."""

"""What the learned blur estimators see of a patch, and the networks that answer from it."""

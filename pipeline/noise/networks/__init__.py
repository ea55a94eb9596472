"""What the learned noise estimators see of a patch, and the networks that answer from it."""

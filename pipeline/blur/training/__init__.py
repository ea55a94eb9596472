"""Training the networks for blur: samples, what is minimised, validation, and the ablation study."""

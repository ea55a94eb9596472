"""Training the networks for noise: samples by sensors and through whole cameras, what is minimised, validation."""

"""Pictures of experiments: image formation, kernels, noise maps, and single examples."""

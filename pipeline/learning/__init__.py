"""Training from scratch on procedural images: pictures, kernels, labelled samples, the loop, and weight files."""

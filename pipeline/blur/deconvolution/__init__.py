"""The parts of blind deconvolution: resampling, boundaries, kernel support, kernel update, latent images."""

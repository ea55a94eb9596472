"""Image formation: photons, optics, dark current, readout, quantisation.

`corruption.corrupt` is the public entry for noise of a target size, in the order of the paper or of a camera;
`exposure.Camera` forms frames from scene radiance at an exposure time and gain; `psf`, `mtf` and `blur` serve optics;
`sensor.Sensor` holds every parameter of the electron-level model.
"""

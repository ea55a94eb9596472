"""Image formation in the order light meets it: photons, optics, dark current, readout, quantisation.

`levels.corrupt` is the public entry for noise; `psf`, `mtf` and `blur` for optics; `sensor.Sensor` holds every
parameter of the electron-level model.
"""

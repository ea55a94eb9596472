"""The processing inside a camera, from linear light to the picture it delivers, one step a file.

    scene -> mosaic -> raw noise -> white balance -> demosaicing -> colour matrix -> tone curve -> denoising
          -> sharpening -> scaling -> 8 bit -> codec -> grey

Every step can be left out. `develop.CameraPipeline` holds the settings of all of them and runs them;
`presets` has named cameras; `temporal_noise` measures the noise that is left in the delivered picture.

Denoising and sharpening act on luma and chroma behind the tone curve, where most cameras' consumer processing does;
noise is white only on the mosaic, every later step correlates it between pixels.
"""

"""What policies measure on the picture itself: mean grey level, gradients, image quality."""

"""What policies carry from frame to frame: filters, hysteresis, searches, and exposure asked for."""

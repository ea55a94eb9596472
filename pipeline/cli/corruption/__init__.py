"""How ``camera-monitor corrupt`` makes pictures and writes them with their truth."""

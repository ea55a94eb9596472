"""``python -m pipeline.cli`` is ``camera-monitor``."""

from pipeline.cli import main

if __name__ == "__main__":
    main()

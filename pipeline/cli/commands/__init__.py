"""The commands of ``camera-monitor``, one per file; the names are in `pipeline.cli.COMMANDS`."""

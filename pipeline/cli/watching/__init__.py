"""What ``camera-monitor watch`` reads and what it follows: sources of frames, rolling state, alarms."""

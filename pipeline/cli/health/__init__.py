"""What ``camera-monitor health`` is asked for and what it writes: table, JSON, and the page with its pictures."""

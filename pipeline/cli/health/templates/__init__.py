"""The template of the page of ``camera-monitor health``."""

"""The files of a new project, which ``camera-monitor init`` copies; as text, so that no tool takes them for code."""

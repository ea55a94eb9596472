"""The template of the health page, and the files of a new project."""

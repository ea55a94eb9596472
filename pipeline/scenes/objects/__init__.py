"""Things that stand in a scene, one kind per file: each makes its shape and defines how it is painted."""

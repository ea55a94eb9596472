"""Things that stand in a scene, one kind per file: each makes its shape and says how it is painted."""

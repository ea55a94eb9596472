"""Control policies, one per file; the names are in `pipeline.control.REGISTRY`."""

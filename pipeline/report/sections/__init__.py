"""The sections of the page, one file each, in the paper's order; what they say is in `pipeline.report.texts`."""

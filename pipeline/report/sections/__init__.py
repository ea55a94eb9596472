"""The sections of the page, one file each, in the paper's order; beside it, its tables, captions and paragraphs."""

"""Average precision expected at settings not yet tried, and what is chosen where it is uncertain."""

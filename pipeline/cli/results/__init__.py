"""Writing results: folders and tables that lose nothing, JSON without a copy in memory, pictures with numbers."""

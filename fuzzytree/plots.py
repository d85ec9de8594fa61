"""Pictures of results: one function for each, which returns a figure."""

"""A log's way from its file to a result."""

"""A run's results in the files that other programs open; one format a file, all in the registry."""

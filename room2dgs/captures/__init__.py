"""A capture on disk as a Scene of posed frames."""

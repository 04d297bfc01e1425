"""What a run leaves on disk: its folder, its settings, its metrics.json."""

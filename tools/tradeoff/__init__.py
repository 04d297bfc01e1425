"""Score against time for several settings on several captures."""

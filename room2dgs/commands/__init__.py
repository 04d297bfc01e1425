"""The commands, one file a verb. Here, and nowhere else in the package, everything meets."""

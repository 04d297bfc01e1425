"""The loss terms as training uses them: one file a kind, all registered in `room2dgs.registries.losses`."""

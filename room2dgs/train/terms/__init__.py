"""The loss terms as training uses them: one file a kind, all in `registry.LOSS_TERMS`."""

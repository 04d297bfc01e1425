"""The mesh's score over the errors of the prior."""

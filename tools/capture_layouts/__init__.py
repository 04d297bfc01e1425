"""One scene in every layout that is read, each written from its format's description, by nothing of the readers."""

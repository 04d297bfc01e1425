"""The network that corrects completed depth, and how it is trained."""

"""A small network for depth, normals and how far to trust them: its parts, losses, augmentation and training."""

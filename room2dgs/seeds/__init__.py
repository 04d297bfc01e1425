"""Seeds: voxel centres of the sparse points, each with k learnable surfels (the paper's Sec. III-B)."""

from room2dgs.seeds.seeds import Seeds, seed_points

__all__ = ["Seeds", "seed_points"]

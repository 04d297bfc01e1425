"""Where proposed depth and normals come from: one file a source, listed in `room2dgs.registries.depth_sources`."""

"""A run to walk through in a browser: our rasterizer on the CPU draws, viser shows."""

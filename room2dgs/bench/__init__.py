"""Benchmarks: of the rasterizer, of priors."""

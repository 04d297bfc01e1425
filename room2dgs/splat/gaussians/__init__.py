"""3D Gaussians: projected as ellipses (EWA), drawn by the surfels' blending."""

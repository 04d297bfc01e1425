"""From a capture to a mesh, a step a module: what `room2dgs.reconstruct` and the commands call.

In the order of a run: `scene` reads the capture, `poses` refines its cameras, `points` finds sparse points, `depth`
estimates the depth of each view, `train` trains surfels, `mesh` makes the mesh (one module of `meshers` for each value
of `mesh.source`), `export` and `render` write files and pictures, `evaluate` scores, `verdict` judges, `report` writes
the page. `reconstruct` is all of them. `depth_maps`, `prepare`, `plan`, `camera_path` and `view` are commands of their
own.

A step takes the scene, the settings (`Config`) and the folder of the run (`RunFolder`), and leaves its files and its
figures in that folder.
"""

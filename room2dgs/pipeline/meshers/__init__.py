"""How a mesh is made, a module for each value of `mesh.source`; `room2dgs.registries.meshers` is their list.

A mesher is a function `surface` (see `mesher.Mesher`). A new one is a module here and its lines in the registry.
"""

"""What a GPU could do at best: work counted from a scene and from the kernels' source, over what a device gives."""

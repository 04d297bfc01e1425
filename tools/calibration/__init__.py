"""Whether the errors that depth and normals are expected to have are right in size."""

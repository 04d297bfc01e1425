"""Networks in ONNX that make depth and normal maps."""

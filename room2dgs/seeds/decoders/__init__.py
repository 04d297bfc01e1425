"""What turns a seed's learnable tensors into surfels."""

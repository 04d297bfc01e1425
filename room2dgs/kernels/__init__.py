"""How compiled kernels are reached: builds of them, operators of torch that dispatch to them by device, and calls."""

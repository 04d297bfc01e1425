"""Hard cases for every kernel and loss term, and how far float32 is from float64 on them."""

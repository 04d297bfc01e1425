"""The CUDA kernels as plain C++ on the CPU, for tests."""



cuda: bool = False

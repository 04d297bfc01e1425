"""A page on this machine that makes runs: drop a capture, choose how fine, watch, look."""

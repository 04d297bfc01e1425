"""One file for each Hydra group of conf/: its fields, their bounds and what they mean; the values live in conf/."""

"""Programs that make captures or what stands for them: the demo room, random rooms, simulated priors, training data."""

"""Is a backend right, and how fast is it: the hard cases, the demo room and times, within a few minutes."""

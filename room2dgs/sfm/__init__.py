"""Structure from motion with known poses: matching, pose refinement and sparse points."""

"""A simulated room with known truth becomes RGB-D frames."""

"""Return maps, fixed points and eigenvalues of the sampled closed loop."""

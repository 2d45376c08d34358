"""The stage-structured quadratic program of Eq. (22) and its solvers."""

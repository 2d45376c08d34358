"""C-MPC on a full closed-loop linearisation (`c-mpc-ltv`): the same cascade, another prediction behind it."""

"""C-MPC on a plan (`c-mpc-plan`): motion, landing place and step times decided anew over this step and the next."""

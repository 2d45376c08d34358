"""How much any controller could hold: optimal control with full knowledge, the disturbance itself maximised."""

"""The paper's figures and tables made again on both plants, with a verdict for each claim.

One module an experiment (`fig3` ... `noise`). Each says which runs it needs (`tasks`), and makes verdicts, figures
and tables of their results (`evaluate`); neither step runs anything. `tasks.py` runs, `report.py` writes.
"""

EXPERIMENTS = {
    "fig3": "Postures of the periodic gait",
    "fig4": "Torques under 40 N in the first step",
    "readings": "Readings of the push on the torso throughout the first step",
    "fig5": "Deviation from the gait under 25 N in the second step",
    "fig6": "Shares of ZD+PD and MPC in the torque",
    "fig7": "Friction ratio with and without the friction rows",
    "fig8": "Basins of attraction",
    "table2": "Largest eigenvalue of the step-to-step map",
    "horizon": "Length of the horizon",
    "incline": "Unexpected ramps",
    "noise": "Noise of sensors and motors",
}
"""Experiments in the order they are run and shown; each is a module of this package."""

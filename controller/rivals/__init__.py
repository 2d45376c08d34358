"""Controllers of other papers (`clf-qp`, `output-mpc`), to be compared with the cascades under equal conditions.

Both linearise the outputs of the same gait, by the same model, and differ in the law that moves them. Each was tuned
by the mean RMS of its outputs over the same six walks of eight steps on MuJoCo: undisturbed; +12, +20 and -6 N on the
torso through step 3; the torso 1.25 times as heavy; and noise of 0.5 mrad and 30 mrad/s on all joints with commands 2
ticks late (seed 901). No plan and no scenario that comes with the program repeats one of these walks; the plan
`montecarlo` also draws pushes through step 3, from a seed of its own. What was tried and chosen stands in the module of
each law.
"""

"""How heavy may the torso be? A study over two controllers, as a table for a paper."""

import sim

PLAN = """
name = "payload"
controllers = ["c-mpc", "zd-pd"]

[scenario]
steps = 5

[[grid]]
name = "mass"

[[grid.axes]]
name = "factor"
paths = ["plant.mass_factor.torso"]
values = [1.0, 1.5, 2.0]
"""

if __name__ == "__main__":  # workers import this file
    results = sim.run_trials(PLAN, workers=1)
    cells = {(row.axis_values["factor"], row.controller): row for row in results}
    factors, kinds = sorted({key[0] for key in cells}), results.plan.controllers
    lines = [r"\begin{tabular}{r" + "l" * len(kinds) + "}", " & ".join(["torso mass", *kinds]) + r" \\ \hline"]
    for factor in factors:
        texts = [
            f"RMS {1e3 * row.output_error_rms_rad:.1f} mrad" if row.survived else f"falls in step {row.steps + 1}"
            for row in (cells[factor, kind] for kind in kinds)
        ]
        lines.append(" & ".join([f"x {factor:g}", *texts]) + r" \\")
    table = "\n".join([*lines, r"\end{tabular}"])
    print(table)
    with open("payload.tex", "w", encoding="utf-8") as file:
        file.write(table + "\n")

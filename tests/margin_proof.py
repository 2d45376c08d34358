"""How often a margin's "holds everything up to" is true where edges are blurred: run it for all 2,000 edges.

    .venv/bin/python tests/margin_proof.py

An edge lies somewhere between 10 and 68 N of a range of 80 N, and is blurred over up to 12 N: within these, values
walk or fall by chance, with even odds in half the edges and with odds that fall from one to nothing in the others.
The statement is true if every value of the lattice up to the stated one walks.
"""

import sys

import numpy as np

from sim.trials.plan.margin import MarginAxis, margin, next_positions

EDGES = 2000
BLUR = 12.0  # [N]


def edge(rng: np.random.Generator, even: bool) -> np.ndarray:
    """Whether each value of 0 to 80 N walks."""
    width = rng.uniform(0.0, BLUR)
    low = rng.uniform(10.0, 68.0)
    value = np.arange(81.0)
    within = np.clip((value - low) / max(width, 1e-9), 0.0, 1.0)
    odds = np.where((within > 0.0) & (within < 1.0), 0.5, 1.0 - within) if even else 1.0 - within
    return rng.random(81) < odds


def tally(edges: int, look: int) -> tuple[int, int, int]:
    """True statements "holds up to", true statements of the first fall, and trials asked for, of this many edges."""
    rng = np.random.default_rng(1)
    axis = MarginAxis(paths=("pushes.0.force",), nominal=0.0, low=0.0, high=80.0, tolerance=1.0, look=look)
    held = fell = trials = 0
    for number in range(edges):
        walks = edge(rng, even=number % 2 == 0)
        known: dict[int, bool] = {}
        while positions := next_positions(axis, 1, known):
            known |= {position: bool(walks[position]) for position in positions}
        found = margin(axis, 1, {p: ["" if ok else "fell"] for p, ok in known.items()})
        up_to = 80 if found.fell_at is None else round(found.value or 0.0)
        held += bool(walks[1 : up_to + 1].all())
        fell += found.fell_at is not None and round(found.fell_at) == int(np.argmin(walks))
        trials += len(known)
    return held, fell, trials


if __name__ == "__main__":
    look = int(sys.argv[1]) if len(sys.argv) > 1 else MarginAxis.__dataclass_fields__["look"].default
    for how in (0, look):
        held, fell, trials = tally(EDGES, how)
        words = f"holds up to A true of {held} of {EDGES} edges ({held / EDGES:.2%}), first fall true of {fell}"
        print(f"look = {how}: {words}; {trials / EDGES:.1f} trials each")

"""What a campaign tries: axes, grids, margins, draws."""

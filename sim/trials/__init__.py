"""Many runs: grids, margins and Monte-Carlo studies, resumable, on all cores or a cluster."""

"""From an MCAP file to arrays, sound or damaged."""

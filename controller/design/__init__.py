"""Offline design: gaits by hybrid zero dynamics, and gains. Nothing here runs in a control tick."""

"""Walkers as people have them: a folder each, with model files."""

"""What every HTML page of the program is made of: one base with one style, one palette, one plotter, SVG."""

from sim.pages.page import link, number, render, write

__all__ = ["link", "number", "render", "write"]

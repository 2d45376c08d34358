"""What every HTML page of the program is made of: one base with one style, one palette, one plotter, SVG."""

from controller.common.files import write
from sim.pages.page import link, number, render

__all__ = ["link", "number", "render", "write"]

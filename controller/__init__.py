"""The controller's world: an analytic belief about the walker, a gait and a law. Never the plant."""

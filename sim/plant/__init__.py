"""The truth: plants, ground, sensors and motors."""

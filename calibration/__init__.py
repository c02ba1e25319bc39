"""Calibrate an intensified camera: response, gain, noise, each with its uncertainty."""

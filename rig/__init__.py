"""Drive the delay generator that times the gate of an image intensifier."""

"""optics of imclab."""

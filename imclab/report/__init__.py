"""report of imclab."""

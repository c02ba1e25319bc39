"""transport of imclab."""

"""commands of imclab."""

"""Programs that measure the figures quoted in the docs: ``python -m tests.figures.NAME``."""

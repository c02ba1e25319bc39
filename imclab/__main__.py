"""``python -m imclab``."""

from imclab.cli import main

main()

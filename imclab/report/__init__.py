"""The validation report: saved comparison, numbers, figures, page.

`render` makes the page from a comparison; `save` and `load` keep one, so that it can be made again
in seconds.
"""

from __future__ import annotations

from imclab.report.context import Context, Curve, Entry
from imclab.report.page import Paths, render
from imclab.report.saved import load, save

__all__ = ["Context", "Curve", "Entry", "Paths", "load", "render", "save"]

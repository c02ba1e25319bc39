"""Where a measured frame shows what a simulated picture shows, and how sure that is.

``register(fixed, moving)`` needs no first guess. It searches rotation, scale and place coarsely,
refines by fitting the clean simulated picture to the raw frame, and says ``ok=False`` with a reason
rather than give a wrong answer.
"""

from __future__ import annotations

from imclab.registration.procedure import register
from imclab.registration.result import Registration

__all__ = ["Registration", "register"]

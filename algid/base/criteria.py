"""What counts as a gap, as at rest, as settled and as undetermined: each once.

What counts as beyond chance stands in `algid.base.significance`.
"""

from __future__ import annotations

GAP = 2.5
"""Periods: a longer step is a gap. A jittering clock stays below, two lost samples lie above."""
BRIDGED = 3.0
"""Periods: samples of another topic further apart are not interpolated between."""
CUT = 5.0
"""Periods: a longer gap cuts a log, and breaks a line that is drawn; a shorter one is filled."""
HOLE = 0.3
"""Seconds: stretches of a track this far apart have no log between them."""

AT_REST = 0.1
"""Share of a joint's RMS speed: where both joints are slower, dry friction may hold them."""
STILL = 0.01
"""Radians: a joint that moves less in a whole log has not moved."""
BESIDE_STILL = 0.02
"""Radians: the same of a joint that is not read, of which the first samples alone are looked at."""
SWINGING = 0.5
"""Radians: where a joint that is not read moves by more, its reaction is in every estimate."""

SETTLED = 0.02
"""Standard deviations: estimates that change by less have settled."""
SETTLED_SIMULATED = 0.05
"""The same where each further round simulates every window anew."""

SAME_LENGTH = 0.01
"""Share of a length: what two rulers differ by."""
UNDETERMINED = 0.5
"""Standard deviation relative to a parameter's size: what is less sure is not determined."""

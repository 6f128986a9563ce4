"""Two recordings side by side: aligned in time, resampled, their differences in numbers.

Recording -> Signals (series, surface) -> offset of the clocks -> differences -> tolerances -> report, pictures, status
"""

from __future__ import annotations

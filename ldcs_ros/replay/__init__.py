"""Replay: the commands of a bag fed to a twin, in log order and in process; nothing passes through DDS.

Recording -> recorded run (scene, settings) -> timed commands (with their places in the run) -> drive -> Twin -> bag
                                                     verdict: the same bytes, or how far apart
"""

from __future__ import annotations

"""Hard cases: a catalogue of scenes that break simulators, a check for each, and one runner for all.

To add a case, add it to the tuple of its chapter (`catalogue.py`, `stiffness.py`, ...); the table, `ldcs study --hard`
and the tests follow. A case that once failed stays.
"""

"""Hard cases: a catalogue of scenes that break simulators, what is right for each, and one runner for all.

To add a case: add it to the list of its file here (`stiffness.py`, `loads.py`, ...); the table, `ldcs study --hard`
and the tests follow. A case that once failed stays.
"""

"""The node of the twin."""

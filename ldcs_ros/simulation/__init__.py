"""The simulation room: the only object that changes, its inputs, and its rest states."""

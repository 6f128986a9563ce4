"""A mock rig that speaks every transport for real: hidden parameters, slow valves, a noisy tracker, faults."""

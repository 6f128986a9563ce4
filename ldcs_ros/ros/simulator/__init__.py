"""The standard simulator services of the node; imported only where the package simulation_interfaces is installed."""

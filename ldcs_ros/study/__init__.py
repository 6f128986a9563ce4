"""Studies of the solvers: what accuracy costs in time, and which hard cases they hold."""

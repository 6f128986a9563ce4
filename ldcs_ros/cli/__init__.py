"""The command line `ldcs <verb>`: one verb a file, needs no ROS.

To add a verb: write `cli/<verb>.py` with `DESCRIPTION`, `EXAMPLE`, `add_arguments(parser)` and
`run(arguments) -> int`, import what is heavy inside `run`, and name the module in `VERBS` of `cli/main.py`.
"""

"""Common parts of the nodes: process, transport, quality of service, parameters, optional packages."""

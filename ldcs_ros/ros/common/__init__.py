"""What the nodes share: process, transport, quality of service, parameters, optional packages."""

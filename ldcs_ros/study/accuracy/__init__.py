"""The study of accuracy: random and violent scenes, an independent reference, and the errors of the product."""

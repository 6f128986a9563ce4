"""The whole surface from two measured points: a Kalman filter on a few modes of the sheet, with consistent covariance.

scene -> basis (equilibria for pressures, loads, stiffnesses) -> ReducedModel -> SurfaceFilter -> Estimate
scene -> runs under random pressures -> QuadraticManifold -> ReducedRun -> shape, error estimate
"""

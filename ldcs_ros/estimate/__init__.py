"""The whole surface from two measured points: a Kalman filter on a few shapes of the sheet, with honest covariance.

scene -> basis (shapes at rest for pressures, loads, stiffnesses) -> ReducedModel -> SurfaceFilter -> Estimate
"""

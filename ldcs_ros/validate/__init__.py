"""The paper's test repeated: Table I, the radius, pictures, the calibration and its confidence.

paper.py holds the printed numbers, measure.py the quantities of an equilibrium, cases.py the compared models.
parameters.py lists the parameters that the paper leaves open; calibration.py fits the scene `paper_calibrated`.
identifiability.py judges the fit, transient.py follows the motion in time, pictures.py and tables.py show the results.
"""

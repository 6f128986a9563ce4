"""The paper's test repeated: Table I, the radius, pictures, what was calibrated and how well it is determined.

paper.py holds the printed numbers, measure.py what is read off a rest state, cases.py the models that are
compared, parameters.py what the paper leaves open,
calibration.py the fit behind the scene `paper_calibrated`, identifiability.py what the data can and
cannot tell, transient.py the motion in time, pictures.py and tables.py what people see.
"""

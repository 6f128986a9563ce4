"""Identification: named numbers of a scene fitted to recordings, inputs in, tracker poses out.

bags -> experiments.py (commands and poses) -> prediction.py (a scene's answer to the same commands)
     -> fitting.py (bounded least squares, several starts, differences in worker processes)
     -> diagnostics.py (confidence, misfit, held-out score) -> scene_file.py (a scene whose header reports the fit)
"""

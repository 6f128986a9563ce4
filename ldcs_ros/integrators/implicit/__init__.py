"""The engine of the implicit methods: stages, predictor, iteration, linear system and its factors."""

"""How far an inspection of three logs errs, on benches that are unlike the model."""

"""The engine of diagnosis: candidates, model runs, healthy unit, posterior, answer."""

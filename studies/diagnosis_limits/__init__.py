"""How small a fault `elevon diagnose` sees, on benches that are unlike its model."""

"""Independent models used by tests only. Nothing in ``elevon`` may import them."""

"""Public logs of real machines, and what Elevon determines and predicts of them."""

"""One documented, versioned, reproducible benchmark set, and baseline scores on it."""

from elevon.benchmark.make import BENCHMARK_VERSION, SIZES, Made, make_benchmark
from elevon.benchmark.score import Score, score_benchmark

__all__ = [
    "BENCHMARK_VERSION",
    "SIZES",
    "Made",
    "Score",
    "make_benchmark",
    "score_benchmark",
]

"""One documented, versioned, reproducible benchmark set, and what `elevon learn` makes of it."""

from studies.benchmark_set.make import BENCHMARK_VERSION, SIZES, Made, make_benchmark
from studies.benchmark_set.score import BenchmarkScores, Score, score_benchmark

__all__ = [
    "BENCHMARK_VERSION",
    "SIZES",
    "BenchmarkScores",
    "Made",
    "Score",
    "make_benchmark",
    "score_benchmark",
]

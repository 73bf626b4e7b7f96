"""evaluate: estimates against the truth, and a verdict; offline and pure."""

from testbench.evaluation.evaluator import evaluate

__all__ = ["evaluate"]

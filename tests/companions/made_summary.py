"""A made summary of a track, for tests of what is said and drawn of it."""

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary


def made_summary(**changed: object) -> OptimizationSummary:
    """A film that takes 1 of 4 W, and whose frames lose 3 % on average, 6 % in the worst of them."""
    given = {
        "video": "film", "display": "desk", "rate_limit": "limit", "power_model": "desk",
        "frames": 100, "duration": 4.0, "budget": 0.5, "budget_unit": BudgetUnit.FACTOR, "achieved": 0.5,
        "objective": 0.012, "objective_baseline": 0.04, "lower_bound": 0.005, "max_rate_ratio": 0.9,
        "mean_contrast_loss": 0.03, "mean_contrast_loss_baseline": 0.04, "mean_factor": 0.5,
        "baseline_factor": 0.5, "mean_power": 1.0, "baseline_power": 1.0, "full_power": 4.0,
        "frames_without_contrast": 0, "limit_curve": "fitted", "modulated": "frame_mean",
        "lowest_factor": 0.2, "pixels_per_degree": 40.0, "contrast_model": "default", "simulated": False,
        "solver": "splitting", "iterations": 4, "calm": 0.0, "solve_s": 0.1, "curves_s": 1.0,
        "bound_s": 0.1, "seed": None, "versions": {}, "provenance": Provenance(),
        "worst_contrast_loss": 0.06, "worst_contrast_loss_baseline": 0.125,
    }  # fmt: skip
    return OptimizationSummary(**{**given, **changed})

"""A rate limit from someone else's trials: a table with one row for each luminance ramp and its answer."""

import numpy as np
import pandas as pd

import evenlight

# In place of pd.read_csv("trials.csv"): simulated answers, 75 % "yes" at 3 % of the luminance per second.
rng = np.random.default_rng(1)
levels, shares = (10.0, 20.0, 40.0, 60.0, 80.0, 100.0), (0.0, 0.01, 0.02, 0.03, 0.045, 0.07)
trials = pd.DataFrame(
    [
        {"participant_id": who, "luminance_cd_m2": level, "rate_cd_m2_s": level * share}
        for who in ("01", "02", "03")
        for level in levels
        for share in shares
        for _ in range(8)
    ]
)
share = trials["rate_cd_m2_s"] / trials["luminance_cd_m2"]
chance = np.where(share > 0, 1 / (1 + np.exp(-(np.log(share.clip(1e-6) / 0.03) * 4 + np.log(3)))), 0.03)
trials["response"] = np.where(rng.random(len(trials)) < chance, "yes", "no")

fit = evenlight.fit_ramps(trials, display="varjo-xr3", simulated=True)
print(fit.thresholds[["participant_id", "luminance_cd_m2", "threshold_cd_m2_s", "ci_low", "ci_high"]].head())
print(fit.rate_limit)
track = evenlight.optimize("checkerboard", budget=0.6, rate_limit=fit.rate_limit)
print(track)

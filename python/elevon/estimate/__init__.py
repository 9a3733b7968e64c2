"""Numbers from data: free parameters, residual fits, covariances that hold, data kept from a fit.

One of each for the whole package: what is free (`Free`), what is estimated (`Estimate`), a robust
regression, a fit of residuals (scipy's, and one of our own where the model runs in lanes), the
covariance under correlated residuals, and the hold-out.
"""

from elevon.estimate.free import Free
from elevon.estimate.number import LEVEL, Determined, Estimate, quantile

__all__ = ["LEVEL", "Determined", "Estimate", "Free", "quantile"]

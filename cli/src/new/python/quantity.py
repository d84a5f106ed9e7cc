"""`skeleton`: the crest factor of a curve."""

import lacuna
import numpy as np


@lacuna.quantity("skeleton")
class Skeleton:
    """Crest factor: the largest magnitude of a curve divided by its root mean square, or by that about its mean.

    It is the square root of two for a sine and larger for impacts. It is undefined for a curve of zeros.
    """

    about_mean: bool = lacuna.option(False, "`true` takes the mean of the values off first.")

    unit = "1"

    def value(self, curve):
        curve = curve - curve.mean() if self.about_mean else curve
        size = np.sqrt(np.mean(curve**2))
        return np.abs(curve).max() / size if size > 0 else np.nan

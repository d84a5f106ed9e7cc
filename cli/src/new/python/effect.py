"""`skeleton`: a zero that drifts."""

import lacuna


@lacuna.effect("skeleton")
class Skeleton:
    """A zero that drifts in proportion to the last axis, equally on all curves."""

    size: dict = lacuna.option({"normal": [0.0, 1.0]}, "Prior of the drift at the end of the axis, in the unit of the response.")

    title, formula, source = "drift of the zero", "y + size t / t_end", "your source"

    def unknowns(self, layout):
        return [lacuna.unknown("skeleton", self.size, unit=layout.unit)]

    def apply(self, response, values, layout):
        return response + values["skeleton"] * layout.grid / layout.grid[-1]

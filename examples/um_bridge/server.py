"""A model behind an UM-Bridge server: the temperature of a heated rod.

    pip install umbridge numpy
    python examples/um_bridge/server.py [PORT]

An uninsulated rod of square cross section is heated at one end by a source of constant flux and loses heat to the air
along its length and at the other end. In the steady state the temperature above that of the air is, at the position x,

    T(x) = c1 exp(-g x) + c2 exp(g x),   g^2 = 4 h / (a k),

with the flux at x = 0 and the loss h T at x = L giving c1 and c2: R. C. Smith, Uncertainty Quantification: Theory,
Implementation, and Applications, SIAM 2014, chapter 3. Units: cm, W, K.
"""

import sys

import numpy as np
import umbridge

WIDTH = 0.95
LENGTH = 70.0


def temperature(inputs, positions):
    """The temperatures for inputs (flux, coefficient) and (conductivity), which may be complex."""
    (flux, coefficient), (conductivity,) = inputs
    g = np.sqrt(4 * coefficient / (WIDTH * conductivity))
    up = np.exp(g * LENGTH) * (coefficient + conductivity * g)
    down = np.exp(-g * LENGTH) * (coefficient - conductivity * g)
    scale = flux / (conductivity * g)
    c1 = -scale * up / (up + down)
    c2 = scale + c1
    return c1 * np.exp(-g * positions) + c2 * np.exp(g * positions)


class Rod(umbridge.Model):
    """Maps the heat flux with the coefficient of heat transfer, and the conductivity, to the temperatures."""

    def __init__(self):
        super().__init__("rod")

    def get_input_sizes(self, config):
        return [2, 1]

    def get_output_sizes(self, config):
        return [len(config["positions"])]

    def __call__(self, parameters, config):
        return [temperature(parameters, np.array(config["positions"])).tolist()]

    def column(self, parameters, vector, direction, config):
        """The derivative along a direction, by a complex step, which is exact to rounding."""
        step = 1e-30
        inputs = [np.array(values, dtype=complex) for values in parameters]
        inputs[vector] += 1j * step * np.array(direction)
        return temperature(inputs, np.array(config["positions"])).imag / step

    def apply_jacobian(self, out_wrt, in_wrt, parameters, vec, config):
        return self.column(parameters, in_wrt, vec, config).tolist()

    def gradient(self, out_wrt, in_wrt, parameters, sens, config):
        columns = np.eye(len(parameters[in_wrt]))
        return [float(self.column(parameters, in_wrt, e, config) @ np.array(sens)) for e in columns]

    def supports_evaluate(self):
        return True

    def supports_gradient(self):
        return True

    def supports_apply_jacobian(self):
        return True


if __name__ == "__main__":
    umbridge.serve_models([Rod()], port=int(sys.argv[1]) if len(sys.argv) > 1 else 4242)

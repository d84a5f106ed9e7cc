//! Built-in plugins under other names, in a library that is loaded: they must give the same bits. In addition, plugins
//! that panic, and one that implements no optional functions.

mod panicking;
mod rigid;

use lacuna_plugins::designs::latin_hypercube::LatinHypercube;
use lacuna_plugins::designs::quadrature::Quadrature;
use lacuna_plugins::discrepancies::autoregressive::Autoregressive;
use lacuna_plugins::discrepancies::gaussian::Gaussian;
use lacuna_plugins::discrepancies::gaussian_process::GaussianProcess;
use lacuna_plugins::discrepancies::student_t::StudentT;
use lacuna_plugins::effects::delay::Delay;
use lacuna_plugins::effects::gain::Gain;
use lacuna_plugins::models::equations::Equations;
use lacuna_plugins::models::mercury_target::MercuryTarget;
use lacuna_plugins::quantities::expression::Expression;
use lacuna_plugins::quantities::rainflow::Rainflow;
use lacuna_plugins::readers::csv::Csv;
use lacuna_plugins::samplers::adaptive_metropolis::AdaptiveMetropolis;
use lacuna_plugins::samplers::affine_invariant_ensemble::AffineInvariantEnsemble;
use lacuna_plugins::samplers::nested::Nested;
use lacuna_plugins::samplers::no_u_turn::NoUTurn;
use lacuna_plugins::surrogates::gaussian_process::GaussianProcess as Kriging;
use lacuna_plugins::surrogates::polynomial_chaos::PolynomialChaos;

use panicking::Panicking;
use rigid::Rigid;

lacuna_plugin::export! {
    Design "twin_latin_hypercube" LatinHypercube,
    Design "twin_quadrature" Quadrature,
    Design "rigid" Rigid as revision 3,
    Discrepancy "twin_autoregressive" Autoregressive,
    Discrepancy "twin_gaussian" Gaussian,
    Discrepancy "twin_gaussian_process" GaussianProcess,
    Discrepancy "twin_student_t" StudentT,
    Effect "twin_delay" Delay,
    Effect "twin_gain" Gain,
    Model "twin_equations" Equations,
    Model "twin_mercury_target" MercuryTarget,
    Quantity "twin_expression" Expression,
    Quantity "twin_rainflow" Rainflow,
    Reader "twin_csv" Csv,
    Sampler "twin_adaptive_metropolis" AdaptiveMetropolis,
    Sampler "twin_affine_invariant_ensemble" AffineInvariantEnsemble,
    Sampler "twin_nested" Nested,
    Sampler "twin_no_u_turn" NoUTurn,
    Surrogate "twin_gaussian_process" Kriging,
    Surrogate "twin_polynomial_chaos" PolynomialChaos,
    Discrepancy "panicking" Panicking,
    Sampler "panicking" Panicking,
}

//! Built-in plugins once more, under other names, in a library that is loaded: they must give the same bits.

use lacuna_plugins::discrepancies::autoregressive::Autoregressive;
use lacuna_plugins::discrepancies::gaussian::Gaussian;
use lacuna_plugins::discrepancies::gaussian_process::GaussianProcess;
use lacuna_plugins::discrepancies::student_t::StudentT;
use lacuna_plugins::samplers::adaptive_metropolis::AdaptiveMetropolis;
use lacuna_plugins::samplers::affine_invariant_ensemble::AffineInvariantEnsemble;
use lacuna_plugins::samplers::nested::Nested;
use lacuna_plugins::samplers::no_u_turn::NoUTurn;

lacuna_plugin::export! {
    Discrepancy "twin_autoregressive" Autoregressive,
    Discrepancy "twin_gaussian" Gaussian,
    Discrepancy "twin_gaussian_process" GaussianProcess,
    Discrepancy "twin_student_t" StudentT,
    Sampler "twin_adaptive_metropolis" AdaptiveMetropolis,
    Sampler "twin_affine_invariant_ensemble" AffineInvariantEnsemble,
    Sampler "twin_nested" Nested,
    Sampler "twin_no_u_turn" NoUTurn,
}

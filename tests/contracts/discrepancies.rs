//! The contract of discrepancies with the options of each.

use lacuna::plugin::Discrepancy;

use crate::{Table, all};

#[test]
fn they_keep_their_contract() {
    let approximate_bayesian_computation = &[
        "tolerance = { known = 0.3 }\nvariance = { half_normal = 1.0 }\nsimulations = 5",
        "metric = \"energy\"\naxis_weight = 3000.0\ntolerance = { half_normal = 1.0 }\nsimulations = 5\n\
         variance = { measured = { known = 1 } }\ndistance_by = { axis = \"time\", windows = 2 }",
        "metric = \"maximum_mean_discrepancy\"\nsample = true\ntolerance = { half_normal = 1.0 }\n\
         variance = { half_normal = 1.0 }\nsimulations = 5",
        "metric = \"jensen_shannon\"\ntolerance = { half_normal = 1.0 }\nbandwidth = 0.2\nsimulations = 5\n\
         variance = { half_normal = 1.0 }\nby = \"sensor\"",
    ];
    let autoregressive = &[
        "variance = { half_normal = 1.0 }\ncorrelation_time = { log_normal = [-9, 1] }",
        "variance = { half_normal = 1.0 }\nby = \"sensor\"\ncorrelation_time = { known = 1e-4 }",
        "variance = { measured = { half_normal = 4 } }\nby = [\"sensor\", { axis = \"time\", windows = 2 }]\n\
         correlation_time = { log_normal = [-9, 1] }\ncorrelation_by = \"sensor\"",
    ];
    let constrained_gaussian_process = &[
        "bias = { half_normal = 1.0 }\ncorrelation_length = { log_normal = [-8, 1] }\n\
         known = [{ at = 0.0, value = 0.1, slope = 100.0 }]\nvariance = { half_normal = 1.0 }",
        "bias = { half_normal = 1.0 }\ncorrelation_length = { log_normal = [-8, 1] }\nbias_by = \"sensor\"\n\
         kernel = \"squared_exponential\"\nmonotone = \"increasing\"\nplaces = 2\n\
         variance = { half_normal = 1.0 }\nby = \"sensor\"",
        "bias = { known = 0.1 }\ncorrelation_length = { known = 3e-4 }\nsign = \"negative\"\nplaces = 3\n\
         kernel = \"matern_3_2\"\nvariance = { measured = { known = 1 } }",
    ];
    let embedded = &[
        "spread = { first = { half_normal = 1.0 }, second = { known = 0.3 } }\n\
         variance = { half_normal = 1.0 }",
        "spread = { first = { half_normal = 1.0 } }\nlikelihood = \"joint\"\n\
         variance = { half_normal = 1.0 }\nby = \"sensor\"",
    ];
    let gaussian = &[
        "variance = { half_normal = 1.0 }",
        "variance = { uniform = [0.0, 10.0] }",
        "variance = { known = 0.04 }",
        "variance = { measured = { inverse_gamma = [3, 4] } }",
        "variance = { half_normal = 1.0 }\nby = \"sensor\"",
        "variance = { half_normal = 1.0 }\nby = [\"sensor\", { axis = \"time\", windows = 2 }]",
        "variance = { measured = { half_normal = 4 } }\nby = \"time\"",
        "variance = { half_normal = 1.0 }\nmarginal = true",
        "variance = { inverse_gamma = [2, 0.1] }\nmarginal = true",
    ];
    let gaussian_process = &[
        "bias = { half_normal = 1.0 }\ncorrelation_length = { log_normal = [-9, 1] }\n\
         variance = { half_normal = 1.0 }",
        "bias = { half_normal = 1.0 }\ncorrelation_length = { log_normal = [-9, 1] }\nbias_by = \"sensor\"\n\
         kernel = \"matern_3_2\"\nvariance = { half_normal = 1.0 }\nby = \"sensor\"",
        "bias = { known = 0.1 }\ncorrelation_length = { known = 1e-4 }\northogonal = false\n\
         variance = { measured = { known = 1 } }",
    ];
    let multiplicative_gaussian = &[
        "relative = { half_normal = 1.0 }\nfloor = { known = 0.2 }",
        "relative = { half_normal = 1.0 }\nby = \"sensor\"\nfloor = { half_normal = 1.0 }",
        "relative = { known = 0.1 }\nfloor = { known = 0.1 }",
    ];
    let pseudo_marginal = &[
        "variance = { half_normal = 1.0 }",
        "variance = { half_normal = 1.0 }\nby = \"sensor\"\nindependent_by = \"sensor\"",
        "variance = { known = 0.04 }\nsimulations = 3",
    ];
    let scaled_gaussian_process = &[
        "bias = { half_normal = 1.0 }\ncorrelation_length = { log_normal = [-8, 1] }\n\
         variance = { half_normal = 1.0 }",
        "bias = { half_normal = 1.0 }\ncorrelation_length = { log_normal = [-8, 1] }\nbias_by = \"sensor\"\n\
         scaling = { log_normal = [5, 1] }\nvariance = { measured = { known = 1 } }",
    ];
    let student_t = &[
        "scale = { half_normal = 1.0 }",
        "scale = { half_normal = 1.0 }\nby = \"sensor\"\ndegrees_of_freedom = { known = 5 }",
        "scale = { known = 0.2 }\ncommon = { share = 0.9, most = 1 }",
    ];
    // Without a noise of its own it has no likelihood of a single response.
    let synthetic_likelihood = &[
        "variance = { half_normal = 1.0 }",
        "variance = { known = 0.04 }\nby = \"sensor\"\nestimator = \"plug_in\"",
    ];
    let table: &Table = &[
        ("approximate_bayesian_computation", approximate_bayesian_computation),
        ("autoregressive", autoregressive),
        ("constrained_gaussian_process", constrained_gaussian_process),
        ("embedded", embedded),
        ("gaussian", gaussian),
        ("gaussian_process", gaussian_process),
        ("multiplicative_gaussian", multiplicative_gaussian),
        ("pseudo_marginal", pseudo_marginal),
        ("scaled_gaussian_process", scaled_gaussian_process),
        // Example of CONTRIBUTING.md.
        ("shot_noise", &["gain = { half_normal = 0.1 }"]),
        ("student_t", student_t),
        ("synthetic_likelihood", synthetic_likelihood),
    ];
    all::<dyn Discrepancy>(table, |case, plugin| lacuna_contract::discrepancy(&case.label, plugin));
}

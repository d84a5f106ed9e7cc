//! Quantities of interest, and methods for the probability that one exceeds a limit.

use lacuna::plugin::{Quantity, Reliability};

use super::{Table, all};

const STEEL: &str = "fatigue_strength_coefficient = { value = 1000, unit = \"MPa\" }\n\
                     fatigue_strength_exponent = -0.1\nmodulus = { value = 200, unit = \"GPa\" }";

#[test]
fn quantities() {
    let strain = format!(
        "{STEEL}\nlaw = \"strain_life\"\nfatigue_ductility_coefficient = 0.2\n\
         fatigue_ductility_exponent = -0.5\nmean_stress = \"smith_watson_topper\""
    );
    let goodman = format!(
        "{STEEL}\nmean_stress = \"goodman\"\nultimate_strength = {{ value = 600, unit = \"MPa\" }}"
    );
    // The tables of the suites are constants; these options are built once.
    let leaked = |text: String| -> &'static str { Box::leak(text.into_boxed_str()) };
    let rainflow: &'static [&'static str] = Box::leak(Box::new([
        STEEL,
        leaked(strain),
        leaked(goodman),
        "output = \"range\"",
        "output = \"cycles\"\nleast_range = 1e-4",
    ]));
    let table: &Table = &[
        ("at", &["place = 2.5e-4", "place = { value = 0.3, unit = \"ms\" }"]),
        ("band", &["frequency = [0, 5000]", "frequency = [{ value = 2, unit = \"kHz\" }, 5000]"]),
        (
            "exceedance",
            &["threshold = 1e-4", "threshold = 1e-4\nabsolute = true\noutput = \"share\""],
        ),
        ("expression", &["formula = \"a / b\"", "formula = \"sqrt(a * 1 {m}) + a\""]),
        ("maximum", &["", "absolute = true"]),
        ("rainflow", rainflow),
        ("rms", &["", "about_mean = true"]),
        ("time_of_maximum", &["", "absolute = true"]),
    ];
    all::<dyn Quantity>(table, |case, plugin| lacuna_contract::quantity(&case.label, plugin));
}

#[test]
fn reliability() {
    let table: &Table = &[
        (
            "active_kriging",
            &["final_samples = 5000", "final_samples = 5000\nbatch = 3\nchecks = 2"],
        ),
        ("form", &["", "design_points = 1"]),
        ("importance_sampling", &["", "batch = 50"]),
        ("monte_carlo", &["", "samples = 5000"]),
        ("sorm", &["", "formula = \"breitung\"", "formula = \"tvedt\""]),
        ("subset_simulation", &["", "level_probability = 0.25\nsamples = 1000"]),
    ];
    all::<dyn Reliability>(table, |case, plugin| lacuna_contract::reliability(&case.label, plugin));
}

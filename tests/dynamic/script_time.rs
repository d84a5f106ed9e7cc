//! Time of a call of a plugin in Python.

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Discrepancy;
use lacuna::plugin::discrepancy::Known;
use lacuna::plugin::registry;
use lacuna_linalg::Matrix;

use crate::quick;
use crate::scripts::{example, has_python, plugins};

/// Time of a likelihood of 120 walkers, 20 replicates and 1000 outputs through a worker, beside that of `numpy` alone.
///
/// `cargo test --test dynamic -- --ignored --nocapture time_of_a_call`
#[test]
#[ignore = "a measurement for the guide"]
fn time_of_a_call() {
    if !has_python() {
        return;
    }
    plugins();
    let built = registry::from_text::<dyn Discrepancy>("heavy_tails", "").unwrap();
    for (replicates, outputs) in [(20, 1000), (20, 100), (4, 21)] {
        let axes =
            vec![Axis::grid("t", (0..outputs).map(|i| i as f64).collect(), Unit::dimensionless())];
        let layout = Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes };
        let mut rng = Stream::root(1).generator();
        let mut row = || (0..outputs).map(|_| Some(normal(&mut rng))).collect();
        let all = (0..replicates).map(|r| Replicate::new(r.to_string(), row())).collect();
        let data = Measurements::new(layout, all);
        let made = built.plugin.likelihood(&Known::without_slopes(&data, &[])).unwrap();
        let (responses, hyper) = (Matrix::zeros(120, outputs), Matrix::from_fn(120, 1, |_, _| 1.0));
        let rounds = 20;
        made.log_likelihoods(&responses, &hyper);
        let begun = std::time::Instant::now();
        (0..rounds).for_each(|_| _ = made.log_likelihoods(&responses, &hyper));
        let whole = begun.elapsed().as_secs_f64() / f64::from(rounds);
        let script = format!(
            "import sys, time\nsys.path.insert(0, {root:?})\nsys.path.insert(0, {example:?})\n\
             import types, numpy as np\nlacuna = types.ModuleType('lacuna')\n\
             exec(open({plugin:?}).read(), lacuna.__dict__)\nsys.modules['lacuna'] = lacuna\n\
             import plugins\np = lacuna.build(plugins.HeavyTails, {{}})\n\
             class D: pass\nd = D()\nd.values = np.random.default_rng(1).standard_normal(({replicates}, {outputs}))\n\
             d.count = np.full({outputs}, {replicates})\nr = np.zeros((120, {outputs}))\nu = {{'scale': np.ones(120)}}\n\
             z = np.zeros({outputs})\np.log_likelihood(r, u, d, z)\nt = time.perf_counter()\n\
             for _ in range({rounds}): p.log_likelihood(r, u, d, z)\nprint((time.perf_counter() - t) / {rounds})\n",
            root = quick::root().join("python"),
            example = example(),
            plugin = quick::root().join("python/lacuna/plugin.py"),
        );
        let python = std::env::var_os("LACUNA_PYTHON").unwrap();
        let output = std::process::Command::new(python).args(["-c", &script]).output().unwrap();
        let alone: f64 = String::from_utf8_lossy(&output.stdout).trim().parse().unwrap();
        let more = 100.0 * (whole / alone - 1.0);
        println!(
            "{replicates} x {outputs}: {:.2} ms, NumPy alone {:.2} ms, {more:.1} % more",
            1e3 * whole,
            1e3 * alone
        );
    }
}

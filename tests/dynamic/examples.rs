//! The examples of plugins outside the source tree, built as their READMEs say, run through the suites and used in
//! their studies.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use lacuna::data::{Axis, Layout, Scenario, Unit};
use lacuna::plugin::model::{Call, EvalError};
use lacuna::plugin::{Context, Discrepancy, Library, Model, Sampler, registry};
use lacuna::text::emit;
use lacuna_engine::host::library;
use lacuna_engine::study::resolve::{Use, load_for};

use super::build::{cargo, product, profile, share_crates};
use super::quick;

/// The Rust example as a library. It is a separate workspace; its copy shares compiled crates with this one.
fn rust() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let (from, to) =
            (quick::root().join("examples/plugin_rust"), profile().with_file_name("example"));
        fs::create_dir_all(to.join("src")).unwrap();
        for entry in fs::read_dir(from.join("src")).unwrap() {
            let path = entry.unwrap().path();
            fs::copy(&path, to.join("src").join(path.file_name().unwrap())).unwrap();
        }
        let manifest = fs::read_to_string(from.join("Cargo.toml")).unwrap();
        let root = format!("path = \"{}/", quick::root().display());
        fs::write(to.join("Cargo.toml"), manifest.replace("path = \"../../", &root)).unwrap();
        share_crates(&to);
        cargo("build", &to);
        product("matern")
    })
}

#[test]
fn the_example_in_rust_keeps_the_contracts() {
    library::load(rust(), None).unwrap_or_else(|e| panic!("{e}"));
    let options = "sd = 0.3\nlength = 2e-4\nnoise = 0.2";
    let built =
        registry::from_text::<dyn Discrepancy>("matern", options).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(lacuna_contract::discrepancy("matern", &*built.plugin), Ok(()));
    assert_eq!(built.plugin.faults()[0].said(), None);
    let built = registry::from_text::<dyn Sampler>("difference_walk", "").unwrap();
    assert_eq!(lacuna_contract::sampler("difference_walk", &*built.plugin), Ok(()));
    assert_eq!(built.plugin.faults()[0].said(), None);
    // Its doc comments become the manual.
    let manual = registry::find::<dyn Discrepancy>("matern").unwrap().documentation();
    assert_eq!(manual.title, "A smooth bias of known size beside known noise.");
    let keys: Vec<&str> = manual.options.iter().map(|option| option.key.as_str()).collect();
    assert_eq!(keys, ["sd", "length", "noise"]);
}

/// Runs the study of an example with another library in place of the one that it names.
fn run(study: &str, library: &Path) -> serde_json::Value {
    let study = quick::root().join("examples").join(study);
    let load = format!("plugins.load=[{}]", emit::string(library.to_str().unwrap()));
    let checked = load_for(&study, std::slice::from_ref(&load), Use::Check);
    assert_eq!(checked.complaints(), "");
    assert!(checked.libraries[0].record.is_some());
    let out = tempfile::tempdir().unwrap();
    quick::run(&study, &[&load, "sampler.steps=400"], out.path())
        .unwrap_or_else(|stop| panic!("{stop}"));
    quick::summary(out.path())
}

#[test]
fn the_study_of_the_example_in_rust_allows_for_the_model_to_be_wrong() {
    let summary = run("plugin_rust/study.toml", rust());
    let of = |key: &str| summary["parameters"]["efficiency"][key].as_f64().unwrap();
    // The truth is 0.65. Without a bias the posterior lies many standard deviations below.
    assert!((of("mean") - 0.65).abs() < 3.0 * of("sd"), "{} ± {}", of("mean"), of("sd"));
    assert!(of("sd") > 0.005, "{}", of("sd"));
}

#[cfg(unix)]
#[test]
fn the_study_of_the_example_in_c_gives_what_the_built_in_law_gives() {
    let folder = tempfile::tempdir().unwrap();
    let source = quick::root().join("examples/plugin_c/plain_gaussian.c");
    let library = super::hostile::compiled(folder.path(), &source, "plain_gaussian", &[]);
    let of = |summary: &serde_json::Value, name: &str, key: &str| {
        summary["parameters"][name][key].as_f64().unwrap()
    };
    let c = run("plugin_c/study.toml", &library);
    // The same study with the built-in discrepancy: the draws differ by round-off at first and then diverge.
    let study = quick::root().join("examples/plugin_c/study.toml");
    let text = std::fs::read_to_string(&study).unwrap();
    let text = text.replace(
        "use = \"plain_gaussian\"\nscale = 0.01",
        "use = \"gaussian\"\nvariance = { half_normal = 0.01 }",
    );
    let data = quick::root().join("configs/simple_machine/work_61.csv");
    let text = text.replace("../../configs/simple_machine/work_61.csv", data.to_str().unwrap());
    let own = folder.path().join("own.toml");
    std::fs::write(&own, text.replace("load = [\"./libplain_gaussian.so\"]", "")).unwrap();
    let out = tempfile::tempdir().unwrap();
    quick::run(&own, &["sampler.steps=400"], out.path()).unwrap();
    let rust = quick::summary(out.path());
    for name in ["efficiency", "variance"] {
        let (a, b) = (of(&c, name, "mean"), of(&rust, name, "mean"));
        let error = of(&c, name, "mcse_mean").hypot(of(&rust, name, "mcse_mean"));
        assert!((a - b).abs() < 4.0 * error, "{name}: {a} {b} ± {error}");
    }
}

/// The library of the simulator in C, loaded.
#[cfg(unix)]
fn rod() -> &'static Library {
    static BUILT: OnceLock<&'static Library> = OnceLock::new();
    BUILT.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap().keep();
        let source = quick::root().join("examples/plugin_c/rod.c");
        let library = super::hostile::compiled(&folder, &source, "rod", &[]);
        library::load(&library, None).unwrap_or_else(|e| panic!("{e}"))
    })
}

#[cfg(unix)]
#[test]
fn the_simulator_in_c_keeps_the_contract_and_comes_near_the_exact_answer() {
    rod();
    let layout = rod_layout([0.1, 0.25, 0.5], "K");
    let parameters = [];
    let scratch = tempfile::tempdir().unwrap();
    let context = Context::new(scratch.path(), &parameters, &layout);
    let of = |options: &str| registry::from_text::<dyn Model>("rod", options).unwrap().plugin;
    let usual = of("");
    assert_eq!(lacuna_contract::model("rod", &*usual, &context, scratch.path()), Ok(()));
    assert_eq!(usual.faults()[0].said(), None);

    // A batch in one call: all succeed except for the one with unstable time steps.
    let inputs = [[1.1e-4, 1e-3], [9e-3, 1e-3], [2.5e-4, 0.0], [f64::NAN, 0.0]];
    let scenario = Scenario::default();
    let calls = inputs.each_ref().map(|inputs| Call::new(inputs, &[], &layout, &scenario));
    let worst = |model: &dyn Model| {
        let answers = model.predict_batch(&calls);
        let [Ok(first), Err(EvalError::Rejected(fast)), Ok(third), Err(EvalError::Rejected(none))] =
            &answers[..]
        else {
            panic!("{answers:?}");
        };
        assert!(fast.contains("are not stable at a diffusivity of 0.009 m2/s"), "{fast}");
        assert!(none.contains("found nan and 0"), "{none}");
        let exact = [0, 2].map(|i| exact(inputs[i]));
        let off = |(y, exact): (&f64, &f64)| (y - exact).abs();
        let pairs = first.values.iter().chain(&third.values).zip(exact.iter().flatten());
        pairs.map(off).fold(0.0, f64::max)
    };
    // Second order in the cell size, first order in the time step.
    let coarse = worst(&*of("cells = 20\nstep = 4.0"));
    let fine = worst(&*usual);
    assert!(fine < 0.2 && (3.0..5.0).contains(&(coarse / fine)), "{coarse} {fine}");
}

/// Layout of temperatures at these positions of the rod, at ten times each.
#[cfg(unix)]
fn rod_layout(places: [f64; 3], unit: &str) -> Layout {
    let unit_of = |text: &str| Unit::parse(text).unwrap();
    let times = (1..=10).map(|k| 100.0 * f64::from(k)).collect();
    let axes = vec![
        Axis::grid("position", places.to_vec(), unit_of("m")),
        Axis::grid("time", times, unit_of("s")),
    ];
    Layout { name: "temperature".to_owned(), unit: unit_of(unit), axes }
}

/// Analytical solution: two half-waves, each with its own decay rate.
#[cfg(unix)]
fn exact([diffusivity, loss]: [f64; 2]) -> Vec<f64> {
    use std::f64::consts::PI;
    let wave = |k: f64, height: f64, x: f64, t: f64| {
        height * (k * PI * x).sin() * (-(diffusivity * (k * PI).powi(2) + loss) * t).exp()
    };
    let at = |x: f64, t: f64| wave(1.0, 80.0, x, t) + wave(3.0, 40.0, x, t);
    let times = || (1..=10).map(|k| 100.0 * f64::from(k));
    [0.1, 0.25, 0.5].into_iter().flat_map(|x| times().map(move |t| at(x, t))).collect()
}

#[cfg(unix)]
#[test]
fn the_simulator_in_c_says_which_responses_it_cannot_give() {
    rod();
    let said =
        |options: &str| registry::from_text::<dyn Model>("rod", options).map(|_| ()).unwrap_err();
    assert!(said("cells = 2").contains("expected a whole number from 4 to 10000"));
    assert!(said("step = -1.0").contains("wrong value for `step`"));
    assert!(said("stp = 1.0").contains("did you mean `step`?"));
    let load = format!("plugins.load=[{}]", emit::string(rod().path.to_str().unwrap()));
    let study = quick::root().join("examples/plugin_c/rod.toml");
    for (setting, expected) in [
        ("response.unit=\"mK\"", "expected a response in K"),
        ("response.axes.position.values=[0.1, 0.25, 1.5]", "expected positions on the rod"),
        ("response.axes.position.unit=\"cm\"", "expected the axes `position` in m and `time` in s"),
    ] {
        let settings = [load.clone(), setting.to_owned()];
        let complaints = load_for(&study, &settings, Use::Run).complaints();
        assert!(complaints.contains(expected), "{setting}: {complaints}");
    }
}

#[cfg(unix)]
#[test]
fn the_study_of_the_simulator_in_c_finds_what_its_data_were_made_with() {
    let summary = run("plugin_c/rod.toml", &rod().path);
    for (name, truth) in [("diffusivity", 117.0), ("loss", 8e-4)] {
        let of = |key: &str| summary["parameters"][name][key].as_f64().unwrap();
        let (mean, sd) = (of("mean"), of("sd"));
        assert!((mean - truth).abs() < 3.0 * sd && sd < 0.05 * truth, "{name}: {mean} ± {sd}");
    }
}

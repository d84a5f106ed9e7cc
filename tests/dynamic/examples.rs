//! The examples of plugins outside the tree, built as their READMEs say, put through the suites and used in their studies.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use lacuna::contract;
use lacuna::plugin::abi::library;
use lacuna::plugin::registry;
use lacuna::plugin::{Discrepancy, Sampler};
use lacuna::study::emit;
use lacuna::study::resolve::{Use, load_for};

use super::quick;

/// The Rust example as a library: a workspace of its own, which shares what is compiled with this one.
fn rust() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let test = std::env::current_exe().unwrap();
        let profile = test.parent().unwrap().parent().unwrap();
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut build = Command::new(cargo);
        build.args(["build", "--quiet", "--target-dir"]).arg(profile.parent().unwrap());
        build.current_dir(quick::root().join("examples/plugin_rust"));
        if profile.ends_with("release") {
            build.arg("--release");
        }
        assert!(build.status().unwrap().success(), "the example in Rust is not built");
        let name =
            format!("{}matern{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
        profile.join(name)
    })
}

#[test]
fn the_example_in_rust_keeps_the_contracts() {
    library::load(rust(), None).unwrap_or_else(|e| panic!("{e}"));
    let options = "sd = 0.3\nlength = 2e-4\nnoise = 0.2";
    let built =
        registry::from_text::<dyn Discrepancy>("matern", options).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(contract::discrepancy("matern", &*built.plugin), Ok(()));
    assert_eq!(built.plugin.fault().unwrap().said(), None);
    let built = registry::from_text::<dyn Sampler>("difference_walk", "").unwrap();
    assert_eq!(contract::sampler("difference_walk", &*built.plugin), Ok(()));
    assert_eq!(built.plugin.fault().unwrap().said(), None);
    // Its documentation is the manual's.
    let manual = registry::find::<dyn Discrepancy>("matern").unwrap().documentation();
    assert_eq!(manual.title, "A smooth bias of known size beside known noise.");
    let keys: Vec<&str> = manual.options.iter().map(|option| option.key.as_str()).collect();
    assert_eq!(keys, ["sd", "length", "noise"]);
}

/// Runs the study of an example with a library in the place of the one that it names.
fn run(example: &str, library: &Path) -> serde_json::Value {
    let study = quick::root().join("examples").join(example).join("study.toml");
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
    let summary = run("plugin_rust", rust());
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
    let c = run("plugin_c", &library);
    // The same study with the built-in law: the draws differ by round-off at first and then go their own ways.
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

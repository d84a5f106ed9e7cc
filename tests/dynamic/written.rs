//! Libraries as written by `lacuna new plugin KIND NAME --library FOLDER`: built, tested by their own tests, run
//! through the suites of their kinds, and used together in one study.

use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;
use std::time::Instant;

use lacuna::plugin::registry::{self, Kind};
use lacuna::plugin::{Design, Discrepancy, Effect, Model, Quantity, Reader, Sampler, Surrogate};
use lacuna_engine::host::library;

use super::build::{cargo, product, profile, share_crates};
use super::contracts::{model, reader, sound};
use super::quick;

/// Kinds that libraries can provide.
const KINDS: [&str; 8] =
    ["design", "discrepancy", "effect", "model", "quantity", "reader", "sampler", "surrogate"];

/// The libraries, by kind. Each is a crate in its own folder that belongs to no workspace.
fn written() -> &'static [PathBuf; 8] {
    static BUILT: OnceLock<[PathBuf; 8]> = OnceLock::new();
    BUILT.get_or_init(|| {
        let begun = Instant::now();
        // Always the same place, so that new build products replace the old ones.
        let all = profile().with_file_name("written");
        if all.exists() {
            fs::remove_dir_all(&all).unwrap();
        }
        let libraries = KINDS.map(|kind| {
            let (folder, name) = (all.join(kind), format!("trial_{kind}"));
            let mut lacuna = quick::command();
            lacuna.args(["new", "plugin", kind, &name, "--library"]).arg(&folder);
            let (code, said) = quick::said(lacuna.current_dir(quick::root()));
            assert_eq!(code, Some(0), "{said}");
            share_crates(&folder);
            cargo("build", &folder);
            let told = cargo("test", &folder);
            assert!(told.contains("it_keeps_the_contract ... ok"), "{told}");
            product(&name)
        });
        println!("{} libraries written, built and tested in {:?}", KINDS.len(), begun.elapsed());
        libraries
    })
}

/// Runs the plugin of a kind through a suite.
fn kept<K: Kind + ?Sized>(suite: impl Fn(&str, &K) -> Result<(), Vec<String>>) {
    let name = format!("trial_{}", K::NAME);
    let built = registry::from_text::<K>(&name, "").unwrap_or_else(|e| panic!("{e}"));
    assert!(built.library.is_some());
    assert_eq!(suite(&name, &*built.plugin), Ok(()));
}

#[test]
fn a_library_of_each_kind_keeps_its_contract_and_serves_one_study() {
    let libraries = written();
    for library in libraries {
        library::load(library, None).unwrap_or_else(|e| panic!("{}: {e}", library.display()));
    }
    kept::<dyn Design>(|name, plugin| sound(plugin, lacuna_contract::design(name, plugin)));
    kept::<dyn Discrepancy>(|name, plugin| {
        sound(plugin, lacuna_contract::discrepancy(name, plugin))
    });
    kept::<dyn Effect>(|name, plugin| sound(plugin, lacuna_contract::effect(name, plugin)));
    kept::<dyn Model>(|name, plugin| sound(plugin, model(name, plugin)));
    kept::<dyn Quantity>(|name, plugin| sound(plugin, lacuna_contract::quantity(name, plugin)));
    kept::<dyn Reader>(|name, plugin| sound(plugin, reader(name, plugin, "columns")));
    kept::<dyn Sampler>(|name, plugin| sound(plugin, lacuna_contract::sampler(name, plugin)));
    kept::<dyn Surrogate>(|name, plugin| sound(plugin, lacuna_contract::surrogate(name, plugin)));
    one_study(libraries);
}

/// A discharging capacitor; every part of the study comes from one of the libraries.
const STUDY: &str = r#"
[study]
name = "written"
title = "The rate of a discharge"
seed = 11
[[parameter]]
name = "amplitude"
unit = "V"
prior = { uniform = [1, 3] }
[[parameter]]
name = "rate"
unit = "1/s"
prior = { uniform = [0.5, 1.5] }
[response]
name = "voltage"
unit = "V"
axes = { time = { first = 0.2, last = 2.0, count = 10, unit = "s" } }
[model]
use = "trial_model"
background = 0.1
[[effect]]
use = "trial_effect"
# Nearly the same as a change of the rate: with a wide prior this sampler would need many steps.
slope = { normal = [0, 0.005] }
[design]
use = "trial_design"
runs = 40
[measurements]
use = "trial_reader"
path = "measured.columns"
[surrogate]
use = "trial_surrogate"
validation = 8
[discrepancy]
use = "trial_discrepancy"
deviation = { half_normal = 0.1 }
[sampler]
use = "trial_sampler"
steps = 20000
width = 0.05
[validate]
emulator_check = 2
"#;

fn one_study(libraries: &[PathBuf]) {
    let folder = tempfile::tempdir().unwrap();
    let (study, out) = (folder.path().join("study.toml"), folder.path().join("out"));
    fs::write(&study, STUDY).unwrap();
    let file = folder.path().join("measured.columns");
    // An amplitude of 2 V that decays at a rate of 1/s; the deterministic scatter corresponds to noise of 0.01 V.
    let row = |(r, i): (u32, u32)| {
        let t = 0.2 * f64::from(i + 1);
        let noise = 0.014 * f64::from(7 * i + 11 * r + i * i * r).sin();
        format!("{} {t} {}\n", r + 1, 2.0 * (-t).exp() + 0.1 + noise)
    };
    let rows: String = (0..4).flat_map(|r| (0..10).map(move |i| (r, i))).map(row).collect();
    fs::write(&file, format!("# by hand\nreplicate time voltage\n{rows}")).unwrap();
    let plugins: Vec<&str> =
        libraries.iter().flat_map(|path| ["--plugin", path.to_str().unwrap()]).collect();
    let mut run = quick::command();
    let (code, said) =
        quick::said(run.arg("run").arg(&study).arg("--out").arg(&out).args(&plugins));
    assert_eq!(code, Some(0), "{said}");
    let summary = quick::summary(&out);
    for (name, truth) in [("amplitude", 2.0), ("rate", 1.0)] {
        let of = |key: &str| summary["parameters"][name][key].as_f64().unwrap();
        let (mean, sd) = (of("mean"), of("sd"));
        assert!((mean - truth).abs() < 3.0 * sd && sd < 0.05, "{name}: {mean} ± {sd}");
    }
    let manifest: serde_json::Value =
        lacuna::run::files::read_json(&out.join("manifest.json")).unwrap();
    assert_eq!(manifest["plugins"].as_array().unwrap().len(), KINDS.len());

    // The reader of a library recognises its files, and no built-in reader claims them.
    let mut inspect = quick::command();
    let output = inspect.arg("inspect").arg(&file).args(&plugins).output().unwrap();
    let seen = String::from_utf8(output.stdout).unwrap();
    assert!(seen.contains("(reader `trial_reader`)") && seen.contains("voltage"), "{seen}");
    let output = quick::command().arg("inspect").arg(&file).output().unwrap();
    let seen = String::from_utf8(output.stderr).unwrap();
    assert!(seen.contains("no reader recognises"), "{seen}");
}

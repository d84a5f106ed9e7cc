//! Typical changes of new users to studies: sections removed, names left out, names from elsewhere, inherited readers.

use std::fs;
use std::path::{Path, PathBuf};

use lacuna_engine::study::resolve;

use crate::quick::{self, replace};

/// A study of `a + b t` without measurements, whose model is a command that counts its calls.
const STUDY: &str = "\
[study]
title = \"A line\"

[[parameter]]
name = \"a\"
prior = { uniform = [0.0, 1.0] }

[[parameter]]
name = \"b\"
prior = { uniform = [0.0, 1.0] }

[response]
name = \"y\"
axes = { sensor = [\"B\", \"C\"], time = { first = 1, last = 3, count = 3, unit = \"s\" } }

[model]
use = \"external\"
command = [\"sh\", \"{{ study }}/model.sh\", \"{{ a }}\", \"{{ b }}\", \"{{ run }}\"]
output = \"json\"

[design]
use = \"sobol\"
runs = 20

[executor]
use = \"local\"
threads = 1

[surrogate]
use = \"polynomial_chaos\"
degree = 1
";

fn line(folder: &Path, script: &str) -> PathBuf {
    fs::create_dir_all(folder).unwrap();
    let path = folder.join("study.toml");
    fs::write(&path, STUDY).unwrap();
    fs::write(
        folder.join("model.sh"),
        format!("echo x >> \"$(dirname \"$0\")/calls\"\n{script}\n"),
    )
    .unwrap();
    path
}

fn calls(folder: &Path) -> usize {
    fs::read_to_string(folder.join("calls")).map_or(0, |text| text.lines().count())
}

const SOUND: &str = "echo \"[[$1, $1, $1], [$2, $2, $2]]\"";

#[test]
fn a_campaign_stops_when_its_first_run_fails_and_none_may() {
    let folder = tempfile::tempdir().unwrap();
    let path = line(folder.path(), "echo no license >&2; exit 3");
    let out = folder.path().join("run");
    let stop = quick::run(&path, &[], &out).err().expect("the study stops").to_string();
    assert!(
        stop.starts_with(
            "the first run, `run001`, failed, and no run may fail, so the others are not made: "
        ),
        "{stop}"
    );
    assert!(stop.contains("no license"), "{stop}");
    assert!(stop.contains("0 of 20 runs"), "{stop}");
    // The thread may have begun the next ones.
    assert!(calls(folder.path()) <= 5, "{}", calls(folder.path()));
    // If some runs may fail, all are tried, and a run that fails later affects only itself.
    let path = line(folder.path(), &format!("test $3 = run001 && exit 3\n{SOUND}"));
    fs::remove_file(folder.path().join("calls")).unwrap();
    let settings = ["simulations.use=netcdf", "simulations.allow_failed=1"];
    let ran = quick::run(&path, &settings, &folder.path().join("some"))
        .unwrap_or_else(|stop| panic!("{stop}"));
    assert_eq!(calls(folder.path()), 20);
    assert!(ran.warnings[0].starts_with("run run001 is left out"), "{:?}", ran.warnings);
    let path = line(folder.path(), &format!("test $3 = run002 && exit 3\n{SOUND}"));
    fs::remove_file(folder.path().join("calls")).unwrap();
    let stop = quick::run(&path, &[], &folder.path().join("later"))
        .err()
        .expect("the study stops")
        .to_string();
    assert!(stop.starts_with("1 of 20 runs failed, first `run002`"), "{stop}");
    assert_eq!(calls(folder.path()), 20);
}

/// An inherited reader is meant for the output of the other study's simulator.
#[test]
fn results_that_lacuna_wrote_are_read_whatever_reader_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = line(folder.path(), SOUND);
    let none = folder.path().join("none");
    let emulator = |out: &Path| fs::read(out.join("4-surrogate/emulator.bin")).unwrap();
    quick::run(&path, &[], &none).unwrap_or_else(|stop| panic!("{stop}"));
    for reader in [
        "simulations={ use = \"sierra\", variable = \"strain_{sensor}\" }",
        "simulations={ use = \"csv\" }",
        "simulations={ use = \"netcdf\", allow_failed = 0.1 }",
    ] {
        let out = folder.path().join("other");
        quick::run(&path, &[reader], &out).unwrap_or_else(|stop| panic!("{reader}: {stop}"));
        assert_eq!(emulator(&out), emulator(&none), "{reader}");
        fs::remove_dir_all(&out).unwrap();
    }
}

#[test]
fn a_section_that_is_false_is_taken_out() {
    let folder = quick::simulated();
    let base = folder.path().join("study.toml");
    replace(
        &base,
        "[sampler]",
        "[numerical_error]\nruns = 2\nmodel = { numerics = { mesh = [16, 72] } }\n\n[sampler]",
    );
    let load = |text: &str| {
        let path = folder.path().join("variant.toml");
        fs::write(&path, format!("extends = \"study.toml\"\n{text}")).unwrap();
        resolve::load(&path, &[])
    };
    let whole = load("").study.unwrap();
    assert!(
        whole.numerical_error.is_some()
            && whole.plugins.measurements.unwrap().common.screen.is_some()
    );
    let less = load("numerical_error = false\n[measurements]\nscreen = false\n");
    let less = less.study.unwrap_or_else(|| panic!("the study has problems"));
    assert!(
        less.numerical_error.is_none()
            && less.plugins.measurements.unwrap().common.screen.is_none()
    );
    assert!(!less.resolved.contains_key("numerical_error"));
    // A further study may bring the section back, and the command line may remove it.
    let set = resolve::load(&base, &["numerical_error=false".to_owned()]).study.unwrap();
    assert!(set.numerical_error.is_none());
    // A required section cannot be removed, and a misspelt section is an error.
    let said = load("response = false\n").complaints();
    assert!(said.contains("the study has no `[response]`"), "{said}");
    let said = load("numerical_eror = false\n").complaints();
    assert!(said.contains("unknown section `numerical_eror`"), "{said}");
}

#[test]
fn names_from_elsewhere_are_answered() {
    let folder = quick::tables();
    let path = folder.path().join("study.toml");
    for (set, meant) in [
        ("sampler.use=nuts", "no_u_turn"),
        ("sampler.use=emcee", "affine_invariant_ensemble"),
        ("sampler.use=mcmc", "affine_invariant_ensemble"),
        ("sampler.use=DRAM", "delayed_rejection_adaptive_metropolis"),
        ("sampler.use=hmc", "hamiltonian"),
        ("sampler.use=smc", "sequential_monte_carlo"),
        ("surrogate.use=pce", "polynomial_chaos"),
        ("surrogate.use=gp", "gaussian_process"),
        ("surrogate.use=PC-kriging", "polynomial_chaos_kriging"),
        ("discrepancy.use=gp", "gaussian_process"),
        ("discrepancy.use=ar1", "autoregressive"),
    ] {
        let said = resolve::load(&path, &[set.to_owned()]).complaints();
        assert!(said.contains(&format!("help: did you mean `{meant}`?")), "{set}: {said}");
        assert!(said.contains(&format!("| {set}\n")), "{said}");
    }
    let design = quick::simulated();
    let said = resolve::load(&design.path().join("study.toml"), &["design.use=lhs".to_owned()])
        .complaints();
    assert!(said.contains("did you mean `latin_hypercube`?"), "{said}");
}

/// An alias belongs to one plugin of its kind and is not the name of any.
#[test]
fn aliases_are_of_one_plugin() {
    use lacuna::plugin::registry::{Kind, entries};
    fn unique<K: Kind + ?Sized>() {
        let mut names: Vec<&str> = entries::<K>().iter().map(|entry| entry.name).collect();
        names.extend(entries::<K>().iter().flat_map(|entry| entry.aliases));
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count, "{}", K::NAME);
    }
    unique::<dyn lacuna::plugin::Sampler>();
    unique::<dyn lacuna::plugin::Surrogate>();
    unique::<dyn lacuna::plugin::Design>();
    unique::<dyn lacuna::plugin::Discrepancy>();
    unique::<dyn lacuna::plugin::Reader>();
    unique::<dyn lacuna::plugin::Executor>();
    unique::<dyn lacuna::plugin::Model>();
}

#[test]
fn studies_without_names_do_not_share_a_run_directory() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a", "b"] {
        line(&folder.path().join(name), SOUND);
    }
    let run = |study: &str| {
        let mut command = quick::command();
        let (code, text) = quick::said(command.args(["run", study]).current_dir(folder.path()));
        assert_eq!(code, Some(0), "{text}");
    };
    let belongs = |name: &str| {
        let text = fs::read_to_string(folder.path().join("runs").join(name).join("study.path"));
        text.map(|text| text.trim().to_owned()).unwrap_or_default()
    };
    let of = |name: &str| folder.path().join(name).display().to_string();
    run("a/study.toml");
    run("b/study.toml");
    // Repeated, in any order, each finds its own directory.
    run("b/study.toml");
    run("a/study.toml");
    assert_eq!((belongs("study"), belongs("b-study")), (of("a/study.toml"), of("b/study.toml")));
    let all = fs::read_dir(folder.path().join("runs")).unwrap().count();
    assert_eq!(all, 2);
    assert_eq!((calls(&folder.path().join("a")), calls(&folder.path().join("b"))), (20, 20));
    // A name that is written out is used as it is; an inherited one belongs to the other study.
    let text = fs::read_to_string(folder.path().join("a/study.toml")).unwrap();
    fs::write(
        folder.path().join("a/study.toml"),
        text.replace("[study]", "[study]\nname = \"line\""),
    )
    .unwrap();
    fs::write(folder.path().join("a/less.toml"), "extends = \"study.toml\"\n[design]\nruns = 10\n")
        .unwrap();
    run("a/study.toml");
    run("a/less.toml");
    assert_eq!((belongs("line"), belongs("less")), (of("a/study.toml"), of("a/less.toml")));
}

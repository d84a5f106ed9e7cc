//! Complete studies with plugins of a library: the same bits as with the built-in ones, and the records kept of the
//! library.

use std::collections::BTreeMap;
use std::path::Path;

use lacuna::text::emit;
use lacuna_engine::study::resolve::{Use, load_for};

use super::{quick, twin_path};

/// Results of a study with these settings.
fn results(study: &Path, settings: &[&str]) -> BTreeMap<String, String> {
    let out = tempfile::tempdir().unwrap();
    let out = out.path();
    quick::run(study, settings, out).unwrap();
    let mut results = quick::results(out);
    // The inputs name the plugins, and so does the summary.
    results.retain(|file, _| !file.ends_with("inputs.sha256"));
    let mut summary = quick::summary(out);
    let summary = summary.as_object_mut().unwrap();
    for key in ["seconds", "components"] {
        summary.remove(key).unwrap();
    }
    results.insert("summary.json".to_owned(), serde_json::to_string(summary).unwrap());
    results
}

fn load_twin() -> String {
    format!("plugins.load+={}", emit::string(twin_path().to_str().unwrap()))
}

#[test]
fn twins_give_the_same_bits() {
    for (discrepancy, sampler, options) in [
        ("gaussian", "affine_invariant_ensemble", &["sampler.walkers=20", "sampler.steps=300"][..]),
        ("gaussian", "no_u_turn", &["sampler.steps=300", "sampler.warm_up=150"]),
        ("student_t", "adaptive_metropolis", &["sampler.steps=1200", "sampler.warm_up=300"]),
    ] {
        let common = match discrepancy {
            "student_t" => "discrepancy.scale={ half_normal = 0.1 }",
            _ => "discrepancy.variance={ half_normal = 0.01 }",
        };
        let [own, twins] = ["", "twin_"].map(|prefix| {
            let uses = [
                format!("discrepancy.use={prefix}{discrepancy}"),
                format!("sampler.use={prefix}{sampler}"),
                load_twin(),
            ];
            let mut settings: Vec<&str> = uses.iter().map(String::as_str).collect();
            settings.push(common);
            settings.extend(options);
            results(&quick::tables().path().join("study.toml"), &settings)
        });
        assert_eq!(own, twins, "{discrepancy} {sampler}");
    }
}

/// Runs the same study with all its plugins from the library, and without.
fn all_twins(study: &Path) {
    let own = results(study, &[]);
    let text = std::fs::read_to_string(study).unwrap();
    // The reader of the simulator's own format is kept, so that it reads the output of the model's twin.
    let twins = text.replace("use = \"", "use = \"twin_").replace("twin_sierra", "sierra");
    std::fs::write(study, twins).unwrap();
    assert_eq!(own, results(study, &[&load_twin()]));
}

#[test]
fn a_study_that_simulates_gives_the_same_bits_from_end_to_end() {
    let folder = quick::simulated();
    all_twins(&folder.path().join("study.toml"));
}

#[test]
fn a_study_with_effects_gives_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("study.toml");
    std::fs::copy(quick::root().join("tests/effects/study.toml"), &study).unwrap();
    // The unknowns of the effect are named after it, whatever the name of its plugin.
    quick::replace(&study, "use = \"gain\"", "use = \"gain\"\nname = \"gain\"");
    quick::replace(&study, "steps = 600", "steps = 80");
    quick::replace(&study, "warm_up = 200", "warm_up = 40");
    let bump = |t: f64, centre: f64| (-2.0 * (t - centre).powi(2)).exp();
    let row = |k: u32| {
        let t = 0.1 * f64::from(k);
        format!("1,near,{t},{}\n1,far,{t},{}\n", 2.0 * bump(t, 2.0), 2.1 * bump(t, 3.1))
    };
    let rows: String = (0..61).map(row).collect();
    let text = format!("replicate,sensor,t,level\n{rows}");
    std::fs::write(folder.path().join("level.csv"), text).unwrap();
    all_twins(&study);
}

#[test]
fn a_run_keeps_what_it_loaded_and_goes_on_with_it() {
    let (folder, out) = (quick::tables(), tempfile::tempdir().unwrap());
    let study = folder.path().join("study.toml");
    let library = folder.path().join("libtwin.so");
    std::fs::copy(twin_path(), &library).unwrap();
    let sha256 = lacuna::run::files::hash_file(&library).unwrap();
    let plugins = format!(
        "[plugins]\nload = [{{ path = \"libtwin.so\", sha256 = \"{sha256}\" }}]\n\n[study]"
    );
    quick::replace(&study, "[study]", &plugins);
    quick::replace(&study, "use = \"gaussian\"", "use = \"twin_gaussian\"");
    let settings = ["sampler.walkers=12", "sampler.steps=100"];
    quick::run(&study, &settings, out.path()).unwrap();

    let text = std::fs::read_to_string(out.path().join("manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&text).unwrap();
    let kept = &manifest["plugins"][0];
    assert_eq!(kept["sha256"], sha256.as_str());
    assert_eq!(kept["name"], "lacuna-twin");
    assert_eq!(kept["abi"], "1.2");
    let named = kept["plugins"].as_array().unwrap();
    assert!(named.contains(&"discrepancy.twin_gaussian".into()), "{named:?}");

    let resolved = out.path().join("resolved.toml");
    let again = quick::run(&resolved, &[], out.path()).unwrap();
    assert_eq!(again.made, Vec::<String>::new());

    // Another file of that name is rejected, since the study pins its hash. A loaded file must not change under the
    // program, so it is removed and written anew.
    std::fs::remove_file(&library).unwrap();
    std::fs::write(&library, "no library").unwrap();
    let complaints = load_for(&resolved, &[], Use::Run).complaints();
    assert!(complaints.contains("it is not the pinned file: expected sha256"), "{complaints}");
}

#[test]
fn a_check_loads_nothing() {
    let folder = quick::tables();
    let study = folder.path().join("study.toml");
    // A file that cannot be loaded, with the record of one that could.
    let record = "lacuna-plugin-record:1.0\ndiscrepancy=unheard_of\nsampler=unheard_of\nend\n";
    std::fs::write(folder.path().join("libheard.so"), record).unwrap();
    quick::replace(&study, "[study]", "[plugins]\nload = [\"libheard.so\"]\n\n[study]");
    quick::replace(&study, "use = \"gaussian\"", "use = \"unheard_of\"\nanything = 3");
    quick::replace(&study, "use = \"affine_invariant_ensemble\"", "use = \"unheard_of\"");
    let checked = load_for(&study, &[], Use::Check);
    assert_eq!(checked.complaints(), "");
    let seen = &checked.libraries[0];
    let plugins = &seen.record.as_ref().unwrap().plugins;
    assert_eq!(plugins.len(), 2);

    // Other problems are still reported.
    let wrong = ["surrogate.degree={ max = -1 }".to_owned()];
    assert!(load_for(&study, &wrong, Use::Check).complaints().contains("degree"));
    // Declarations are temporary: a study without the library does not know the plugin.
    quick::replace(&study, "load = [\"libheard.so\"]", "load = []");
    let complaints = load_for(&study, &[], Use::Check).complaints();
    assert!(complaints.contains("there is no discrepancy `unheard_of`"), "{complaints}");
}

#[test]
fn a_design_that_cannot_grow_says_so_and_nothing_is_changed() {
    let folder = quick::simulated();
    let (study, out) = (folder.path().join("study.toml"), folder.path().join("run"));
    quick::replace(&study, "use = \"latin_hypercube\"", "use = \"rigid\"");
    quick::run(&study, &[&load_twin()], &out).unwrap();
    let resolved = || std::fs::read_to_string(out.join("resolved.toml")).unwrap();
    let before = resolved();
    let run = lacuna_run::RunDirectory::open(&out).unwrap();
    let stop = lacuna_engine::campaign::extend(&run, 4).unwrap_err();
    let message = "this design cannot be extended without moving its points";
    assert!(stop.message.starts_with("design `rigid` of ") && stop.message.ends_with(message));
    assert!(stop.help.unwrap().contains("a greater number of `runs`"));
    assert_eq!(resolved(), before);
    assert!(out.join("manifest.json").exists());
}

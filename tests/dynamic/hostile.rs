//! Broken libraries: each gives an error that names it, and the program continues.

use std::path::{Path, PathBuf};
use std::process::Command;

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::plugin::discrepancy::Known;
use lacuna::plugin::registry::{self, Built};
use lacuna::plugin::{Discrepancy, Likelihood};
use lacuna_engine::host::library;
use lacuna_engine::study::resolve::{Use, load_for};

use super::quick;

/// Compiles a library from C, with these flags besides those that turn warnings into errors.
pub fn compiled(folder: &Path, source: &Path, name: &str, flags: &[String]) -> PathBuf {
    let library = folder.join(format!("lib{name}.so"));
    let output = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-fPIC", "-shared"])
        .args(["-I", quick::root().join("sdk/include").to_str().unwrap()])
        .args(flags)
        .arg(source)
        .arg("-o")
        .arg(&library)
        .arg("-lm")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    library
}

/// Compiles a library that misbehaves as the definitions say. It writes one letter to the file `ended` for each object
/// that it frees.
pub fn misguided(folder: &Path, source: &str, name: &str, defines: &[&str]) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("dynamic").join(source);
    let ended = folder.join("ended").display().to_string();
    let own = [format!("NAME=\"{name}\""), format!("ENDED=\"{ended}\"")];
    let defines = defines.iter().map(ToString::to_string).chain(own);
    let mut flags: Vec<String> = defines.map(|define| format!("-D{define}")).collect();
    // Each kind of misbehaviour leaves something unused.
    flags.push("-Wno-unused".to_owned());
    compiled(folder, &source, name, &flags)
}

fn broken(folder: &Path, name: &str, defines: &[&str]) -> PathBuf {
    misguided(folder, "hostile.c", name, defines)
}

/// The error of loading such a library.
fn refused(name: &str, defines: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    library::load(&broken(folder.path(), name, defines), None).unwrap_err()
}

#[test]
fn a_library_that_cannot_be_used_says_why() {
    for (name, define, expected) in [
        ("no_symbol", "NO_SYMBOL", "it has no symbol `lacuna_plugin`"),
        ("wrong_magic", "WRONG_MAGIC", "does not begin as a declaration does"),
        (
            "wrong_major",
            "WRONG_MAJOR",
            "it is made for version 9.2 of the boundary, and this program speaks 1.2",
        ),
        ("newer_minor", "NEWER_MINOR", "it is made for version 1.99 of the boundary"),
        ("aborts", "ABORTS", "it is built with `panic = \"abort\"`"),
        ("no_entries", "NO_ENTRIES", "its declaration has 0 entries"),
        ("small", "SMALL_DECLARATION", "its declaration has 8 bytes"),
        (
            "wrong_kind",
            "WRONG_KIND",
            "its oracle `wrong_kind` is of a kind that libraries cannot hold",
        ),
        ("taken", "NAME_TAKEN", "its discrepancy `gaussian` has a name that is taken"),
        ("twice", "TWICE", "it holds two plugins `discrepancy.twice`"),
        ("bad_name", "BAD_NAME", "`Bad name` is no name for a plugin"),
        (
            "no_function",
            "NO_FUNCTION",
            "its discrepancy `no_function` has no function `likelihood`",
        ),
        ("no_schema", "SCHEMA_IS_NONE", "gives a schema of its options that is none"),
        (
            "deep_schema",
            "SCHEMA_IS_DEEP",
            "that is none: `schema` answers JSON that cannot be read: recursion limit",
        ),
        ("no_start", "DOES_NOT_START", "it does not start: status 3"),
        (
            "no_revision",
            "NO_REVISION",
            "its discrepancy `no_revision` has the revision 0, expected a number from 1",
        ),
    ] {
        let said = refused(name, &[define]);
        assert!(said.contains(expected), "{name}: {said}");
    }
}

#[test]
fn a_file_that_is_no_library_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("libnothing.so");
    assert_eq!(library::load(&file, None).unwrap_err(), "no such file or directory");
    std::fs::write(&file, "nothing").unwrap();
    let said = library::load(&file, None).unwrap_err();
    assert!(said.starts_with("it cannot be loaded: "), "{said}");
    let said = library::load(&file, Some("12ab")).unwrap_err();
    assert!(said.contains("expected sha256 `12ab`"), "{said}");
}

/// Ten outputs, five replicates.
pub fn data() -> Measurements {
    let axes = vec![Axis::grid("time", (0..10).map(f64::from).collect(), Unit::dimensionless())];
    let layout = Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes };
    let replicate = |r: usize| {
        Replicate::new(
            format!("p{r}"),
            (0..10).map(|i| Some(f64::from(i).sin() + 0.1 * r as f64)).collect(),
        )
    };
    Measurements::new(layout, (0..5).map(replicate).collect())
}

/// A discrepancy that misbehaves in one way.
pub fn misbehaving(name: &str, define: &str) -> Built<dyn Discrepancy> {
    let folder = tempfile::tempdir().unwrap();
    library::load(&broken(folder.path(), name, &[define]), None).unwrap_or_else(|e| panic!("{e}"));
    registry::from_text::<dyn Discrepancy>(name, "").unwrap_or_else(|e| panic!("{e}"))
}

pub fn likelihood(built: &Built<dyn Discrepancy>) -> Result<Box<dyn Likelihood>, String> {
    built.plugin.likelihood(&Known::without_slopes(&data(), &[])).map_err(|stop| stop.to_string())
}

#[test]
fn what_cannot_be_made_is_an_error_that_names_the_library() {
    for (name, define, expected) in [
        ("stops", "LIKELIHOOD_STOPS", "discrepancy `stops` of libstops.so: there is nothing to do"),
        ("silent", "LIKELIHOOD_FAILS_SILENTLY", "`likelihood` fails and does not say why"),
        ("odd_status", "ODD_STATUS", "answers with the status 77, which has no meaning"),
        ("makes_nothing", "LIKELIHOOD_MAKES_NOTHING", "its likelihood has no functions"),
        ("lacks", "LIKELIHOOD_LACKS", "its likelihood has no function `gradient`"),
        ("not_json", "NOT_JSON", "`hyperparameters` answers JSON that cannot be read"),
        ("not_text", "NOT_TEXT", "`hyperparameters` answers JSON that cannot be read"),
        ("absent", "LIKELIHOOD_ABSENT", "`likelihood` is not there"),
        ("no_object", "NO_LIKELIHOOD", "its likelihood is not there"),
        ("half_a_table", "HALF_A_TABLE", "its likelihood has a table of"),
        (
            "endless_text",
            "ENDLESS_TEXT",
            "`hyperparameters` gives a text of 18446744073709551615 bytes, which cannot be",
        ),
        ("no_text", "NO_TEXT", "`hyperparameters` gives a text of 2 bytes, which cannot be"),
        ("one_name", "ONE_NAME", "unknown 2 is called `v`, expected a name of its own"),
    ] {
        let built = misbehaving(name, define);
        let said = likelihood(&built).map(|_| ()).unwrap_err();
        assert!(
            said.contains(expected) && said.contains(&format!("lib{name}.so")),
            "{name}: {said}"
        );
    }
}

#[test]
fn what_has_no_room_for_an_error_is_a_fault_that_names_the_library() {
    type Ask = fn(&dyn Likelihood);
    let value: Ask = |l| assert_eq!(l.log_likelihood(&[0.0; 10], &[1.0]), f64::NEG_INFINITY);
    let slopes: Ask = |l| assert_eq!(l.gradient(&[0.0; 10], &[1.0]).0, [0.0; 10]);
    let parts: Ask = |l| assert!(l.predictive(&[0.0; 10], &[1.0]).is_empty());
    let made: Ask = |l| {
        let stream = lacuna::math::random::Stream::root(1);
        assert_eq!(l.simulate(&[0.0; 10], &[1.0], &stream), [data()]);
    };
    let left: Ask = |l| assert_eq!(l.left_out(&[0.0; 10], &[1.0]), None);
    let sampled: Ask = |l| assert_eq!(l.sampled_errors(&[1.0]), None);
    for (name, define, ask, expected) in [
        ("nan", "NAN_VALUES", value, "`log_likelihood` gives no number as value 1 of 1"),
        ("unwritten", "UNWRITTEN", value, "`log_likelihood` gives no number as value 1 of 1"),
        ("rejects", "VALUES_REJECTED", value, "not today"),
        ("endless", "ENDLESS_VALUES", value, "`log_likelihood` gives inf as value 1 of 1"),
        ("nan_slopes", "NAN_SLOPES", slopes, "`gradient` gives no number as value 1 of 10"),
        (
            "short_parts",
            "SHORT_PARTS",
            parts,
            "`predictive` answers 1 rows of 3 numbers where 1 of 10 belong",
        ),
        ("no_parts", "NO_PARTS", parts, "`predictive` answers 0 matrices where 1 belong"),
        ("endless_parts", "ENDLESS_PARTS", parts, "10 numbers, more than there can be"),
        (
            "nowhere",
            "PARTS_NOWHERE",
            parts,
            "`predictive` gives 1 rows of 10 numbers, and none is there",
        ),
        (
            "askew",
            "PARTS_ASKEW",
            parts,
            "`predictive` gives 1 rows of 9 numbers, where no number can be",
        ),
        ("below_zero", "PARTS_BELOW_ZERO", parts, "`predictive` gives the variance -1"),
        ("nan_data", "NAN_DATA", made, "`simulate` gives no number as value 1 of 50"),
        (
            "short_left",
            "SHORT_LEFT_OUT",
            left,
            "`left_out` answers 3 numbers for 50 measured values",
        ),
        (
            "short_sampled",
            "SHORT_SAMPLED",
            sampled,
            "`sampled_errors` answers 9 rows of 1 numbers where 10 of 1 belong",
        ),
        ("sampled_below", "SAMPLED_BELOW_ZERO", sampled, "`sampled_errors` gives the variance -1"),
    ] {
        let built = misbehaving(name, define);
        let likelihood = likelihood(&built).unwrap();
        assert_eq!(likelihood.failure(), None, "{name}");
        ask(&*likelihood);
        let said = likelihood.failure().unwrap();
        assert!(
            said.contains(expected) && said.contains(&format!("lib{name}.so")),
            "{name}: {said}"
        );
    }
}

#[test]
fn tables_of_other_versions_are_read_as_far_as_both_sides_know_them() {
    for (name, define) in [("earlier", "EARLIER_TABLE"), ("later", "LATER_TABLE")] {
        let built = misbehaving(name, define);
        let likelihood = likelihood(&built).unwrap();
        assert_eq!(likelihood.log_likelihood(&[0.0; 10], &[1.0]), -1.0);
        assert_eq!(likelihood.left_out(&[0.0; 10], &[1.0]), None);
        assert_eq!(likelihood.failure(), None, "{name}");
    }
}

#[test]
fn what_was_made_is_ended_once() {
    for (name, define, expected) in [
        ("ends", "SOUND", "lp"),
        ("ends_lacking", "LIKELIHOOD_LACKS", "lp"),
        ("ends_unread", "NOT_JSON", "lp"),
        ("ends_nothing", "LIKELIHOOD_STOPS", "p"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let library = broken(folder.path(), name, &[define]);
        library::load(&library, None).unwrap_or_else(|e| panic!("{e}"));
        let built = registry::from_text::<dyn Discrepancy>(name, "").unwrap();
        drop(likelihood(&built));
        drop(built);
        let ended = std::fs::read_to_string(folder.path().join("ended")).unwrap();
        assert_eq!(ended, expected, "{name}");
    }
}

#[test]
fn a_fault_stops_a_run_and_nothing_of_it_is_kept() {
    let tables = quick::tables();
    let study = tables.path().join("study.toml");
    broken(tables.path(), "faulty", &["NAN_VALUES"]);
    quick::replace(&study, "[study]", "[plugins]\nload = [\"libfaulty.so\"]\n\n[study]");
    quick::replace(
        &study,
        "use = \"gaussian\"\nvariance = { half_normal = 0.01 }",
        "use = \"faulty\"",
    );
    let out = tempfile::tempdir().unwrap();
    let stop =
        quick::run(&study, &["sampler.walkers=12", "sampler.steps=20"], out.path()).err().unwrap();
    assert!(stop.message.contains("discrepancy `faulty` of libfaulty.so"), "{stop}");
    assert!(stop.message.contains("`log_likelihood` gives no number"), "{stop}");
    assert!(out.path().join("4-surrogate/stage.json").exists());
    assert!(!out.path().join("5-calibrate/stage.json").exists());
}

#[test]
fn a_study_says_at_which_line_a_library_is_broken() {
    let tables = quick::tables();
    let study = tables.path().join("study.toml");
    broken(tables.path(), "old", &["WRONG_MAJOR"]);
    quick::replace(
        &study,
        "[study]",
        "[plugins]\nload = [\"libold.so\", \"libnone.so\"]\n\n[study]",
    );
    let complaints = load_for(&study, &[], Use::Run).complaints();
    let old = "the library of plugins libold.so cannot be used: it is made for version 9.2 of the boundary";
    assert!(complaints.contains(old), "{complaints}");
    let none = "the library of plugins libnone.so cannot be used: no such file or directory";
    assert!(complaints.contains(none), "{complaints}");
    assert!(complaints.contains("6 | load = [\"libold.so\", \"libnone.so\"]"), "{complaints}");
}

#[test]
fn options_of_a_library_are_checked_by_its_schema() {
    let folder = tempfile::tempdir().unwrap();
    let source = quick::root().join("examples/plugin_c/plain_gaussian.c");
    let path = compiled(folder.path(), &source, "plain_gaussian", &[]);
    library::load(&path, None).unwrap_or_else(|e| panic!("{e}"));
    let said = |options| {
        registry::from_text::<dyn Discrepancy>("plain_gaussian", options).map(|_| ()).unwrap_err()
    };
    assert!(said("scal = 1").contains("unknown key `scal`"), "{}", said("scal = 1"));
    assert!(said("scal = 1").contains("did you mean `scale`?"));
    assert!(said("").contains("missing key `scale`"));
    let wrong = said("scale = -1");
    assert!(
        wrong.contains("wrong value for `scale`") && wrong.contains("expected a number above 0"),
        "{wrong}"
    );

    let built = registry::from_text::<dyn Discrepancy>("plain_gaussian", "scale = 1.0").unwrap();
    assert_eq!(lacuna_contract::discrepancy("plain_gaussian", &*built.plugin), Ok(()));
    assert_eq!(built.plugin.faults()[0].said(), None);
    // An independent implementation in another language of the built-in discrepancy.
    let own =
        registry::from_text::<dyn Discrepancy>("gaussian", "variance = { half_normal = 1.0 }")
            .unwrap();
    let factor =
        lacuna_linalg::Matrix::from_fn(10, 2, |i, j| 0.1 * (1.0 + i as f64 - 2.0 * j as f64).cos());
    let common = [lacuna::plugin::discrepancy::CommonError {
        origin: lacuna::plugin::discrepancy::ErrorOrigin::Emulator,
        factor: factor.into(),
        predictive: true,
    }];
    let of = |built: &Built<dyn Discrepancy>| {
        built.plugin.likelihood(&Known::without_slopes(&data(), &common)).unwrap()
    };
    let (c, rust) = (of(&built), of(&own));
    for v in [0.01, 0.3, 2.0] {
        let response: Vec<f64> = (0..10).map(|i| (0.9 * f64::from(i)).sin()).collect();
        let (found, expected) =
            (c.log_likelihood(&response, &[v]), rust.log_likelihood(&response, &[v]));
        assert!((found - expected).abs() < 1e-9 * expected.abs(), "{found} {expected}");
        let (found, expected) = (c.gradient(&response, &[v]), rust.gradient(&response, &[v]));
        let pairs = found.0.iter().chain(&found.1).zip(expected.0.iter().chain(&expected.1));
        for (a, b) in pairs {
            assert!((a - b).abs() < 1e-8 * (1.0 + b.abs()), "{a} {b}");
        }
    }
}

/// The header is valid C++ too: the same example, compiled as C++.
#[test]
fn the_header_serves_another_language() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("plugin.cpp");
    let text = "#include \"lacuna_plugin.h\"\n\
                static int32_t schema(const LacunaAnswer *answer) { lacuna_say(answer, \"{}\", 2); return LACUNA_OK; }\n\
                static int32_t create(LacunaText, void **out, const LacunaAnswer *) { *out = out; return LACUNA_OK; }\n\
                static void destroy(void *) {}\n\
                static int32_t points(void *, size_t count, size_t dimension, LacunaKey, double *to, const LacunaAnswer *)\n\
                { for (size_t i = 0; i < count * dimension; ++i) to[i] = 0.5; return LACUNA_OK; }\n\
                static const LacunaComponentFunctions component = { sizeof component, schema, create, destroy, 0, 0, 0, 0 };\n\
                static const LacunaDesignFunctions design = { sizeof design, points, 0, 0 };\n\
                static const LacunaEntry entries[] = { LACUNA_ENTRY(\"design\", \"middle\", component, design) };\n\
                LACUNA_DECLARE(\"middle\", \"1\", LACUNA_PROVIDES(\"design\", \"middle\"), entries);\n";
    std::fs::write(&source, text).unwrap();
    let there = Command::new("c++").arg("--version").output().is_ok();
    if !there {
        println!("skipped: there is no `c++`");
        return;
    }
    let library = folder.path().join("libmiddle.so");
    let include = quick::root().join("sdk/include");
    let output = Command::new("c++")
        .args(["-std=c++11", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-I"])
        .args([&include, &source])
        .arg("-o")
        .arg(&library)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    library::load(&library, None).unwrap_or_else(|e| panic!("{e}"));
    let built = registry::from_text::<dyn lacuna::plugin::Design>("middle", "").unwrap();
    let points = built.plugin.points(3, 2, &lacuna::math::random::Stream::root(1)).unwrap();
    assert_eq!(points.as_slice(), [0.5; 6]);
    // Functions that it leaves out behave like the defaults of a plugin in the source tree.
    assert_eq!(built.revision, 1);
    let stop = built.plugin.extend(&[], &points, 2, &lacuna::math::random::Stream::root(1));
    let stop = stop.unwrap_err();
    assert_eq!(stop.message, "this design cannot be extended without moving its points");
    assert!(stop.help.unwrap().contains("a greater number of `runs`"));
}

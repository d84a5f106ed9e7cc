//! Actions that a study must not take before it runs, and conditions that it must survive: names that are paths, sizes
//! that no machine can hold, programs that `check` would start, posteriors that are narrow or lie in a corner.

use std::fs;
use std::path::Path;
use std::time::Instant;

use lacuna_engine::study::resolve::{Use, load_for, load_text};
use lacuna_engine::study::sizes::fits_on_disk;

use crate::quick;

/// Problems of the study of the skeleton with one text replaced by another.
fn said(old: &str, new: &str) -> String {
    let folder = quick::tables();
    let path = folder.path().join("study.toml");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(old), "no `{old}`");
    let checked = load_text(&path, &text.replace(old, new), &[]);
    checked.complaints().replace(&folder.path().display().to_string(), "DIR")
}

#[test]
fn names_that_become_files_are_no_paths() {
    for name in ["../../evil", "/evil", "a/b", "..", ".", "", ".hidden", "a\\\\b", "x\\ny"] {
        let text = said("name = \"oscillator\"", &format!("name = \"{name}\""));
        assert!(text.contains("wrong value for `name`"), "{name}: {text}");
        assert!(text.contains("expected a plain name for files"), "{name}: {text}");
    }
    let scenario = "[[scenario]]\nname = \"../up\"\n\n[response]";
    let text = said("[response]", scenario);
    assert!(text.contains("a scenario cannot be called this"), "{text}");
    let text = load_text(Path::new("..toml"), "[study]\ntitle = \"x\"\n", &[]).complaints();
    assert!(!text.contains("panicked"), "{text}");
}

#[test]
fn names_that_no_result_can_hold_are_refused_where_they_stand() {
    let long = "x".repeat(201);
    let name = |name: &str| said("name = \"damping\"", &format!("name = \"{name}\""));
    assert!(name(&long).contains("expected a name of at most 200 bytes, found 201 bytes"));
    assert_eq!(name(&long[..200]), "");
    let axis = |label: &str| {
        let axes = format!("axes = {{ sensor = [\"A\", \"{label}\"], time");
        said("axes = { time", &axes)
    };
    for label in ["a\\u0000b", "a\\nb", "\\u007f"] {
        let text = axis(label);
        assert!(text.contains("the axis `sensor`: expected a label without control"), "{text}");
    }
    let text = axis(&long);
    assert!(text.contains("the axis `sensor`: expected a label of at most 200 bytes"), "{text}");
    let scenario =
        "[[scenario]]\nname = \"cold\"\nlabels = { batch = \"a\\u0000b\" }\n\n[response]";
    let text = said("[response]", scenario);
    assert!(text.contains("the label `batch`: expected a label without control"), "{text}");
}

/// Each size of a study that makes its runs, set to a value that exceeds any machine's memory.
#[test]
fn impossible_sizes_are_refused_where_they_stand() {
    let folder = quick::simulated();
    let path = folder.path().join("study.toml");
    let complaints = |settings: &[&str]| {
        let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
        let begun = Instant::now();
        let text = load_for(&path, &settings, Use::Check).complaints();
        assert!(begun.elapsed().as_secs_f64() < 5.0, "{settings:?} takes {:?}", begun.elapsed());
        text
    };
    assert_eq!(complaints(&[]), "");
    for (setting, key, what) in [
        ("design.runs=1000000000000", "design.runs", "the runs need"),
        ("design.runs=9223372036854775807", "design.runs", "the runs need"),
        ("design.runs=1e12", "design.runs", "the runs need"),
        ("design.extended=[9223372036854775807, 5]", "design.extended", "the runs need"),
        ("sampler.steps=1000000000000", "sampler.steps", "is no possible size"),
        ("sampler.steps=2000000000", "sampler.steps", "the draws need"),
        ("sampler.walkers=1000000000000", "sampler.walkers", "is no possible size"),
        ("sampler.walkers=2000000000", "sampler.walkers", "the draws need"),
        ("surrogate.degree=1000000000000", "surrogate.degree", "is no possible size"),
        ("surrogate.degree=1000000", "surrogate.degree", "must be an increasing range"),
        ("response.axes.time.count=1000000000000", "response.axes.time", "needs 500 TB of memory"),
        ("response.axes.time.count=9223372036854775807", "response.axes.time", "of memory"),
        ("validate.emulator_check=1000000000000", "validate.emulator_check", "the runs need"),
        ("surrogate.validation=9223372036854775807", "surrogate", "more runs"),
        ("surrogate.refine.runs=1000000000000", "surrogate.refine.runs", "the runs of all rounds"),
        (
            "surrogate.refine={runs=5,rounds=1000000000000}",
            "surrogate.refine.rounds",
            "of all rounds",
        ),
        ("sampler.stop.effective_sample_size=10", "", ""),
    ] {
        let text = complaints(&[setting]);
        assert_eq!(text.is_empty(), what.is_empty(), "{setting}: {text}");
        assert!(text.contains(what), "{setting}: {text}");
        let last = key.rsplit('.').next().unwrap();
        assert!(text.contains(last), "{setting}: {text}");
        let bounded = text.contains("expected") || text.contains("from 1 to 1000");
        assert!(what.is_empty() || bounded, "{setting}: {text}");
    }
    let many: Vec<String> =
        ["use=nested", "live=2000000000"].map(|s| format!("sampler.{s}")).into();
    let text = complaints(&many.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(text.contains("the draws need"), "{text}");
    // The number of halvings may be arbitrarily large: the run ends by itself, and steps are not draws.
    let fine = complaints(&["sampler.use=nested", "sampler.halvings=1000000000"]);
    assert!(!fine.contains("memory"), "{fine}");
}

#[test]
fn fixed_values_are_finite() {
    let checked = |z: &str, companion: &str| {
        let text = format!(
            "[study]\ntitle = \"x\"\n[[parameter]]\nname = \"a\"\nprior = {{ uniform = [0, 4] }}\n\
             [response]\nname = \"y\"\n[model]\nuse = \"equations\"\nobserve = \"a + z\"\n\
             fixed = {{ z = {z} }}\n[design]\nuse = \"random\"\nruns = 30\n[surrogate]\n\
             use = \"polynomial_chaos\"\ndegree = 2\n{companion}"
        );
        load_text(Path::new("study.toml"), &text, &[]).complaints()
    };
    assert_eq!(checked("1.5", ""), "");
    for z in ["-inf", "nan"] {
        let text = checked(z, "");
        assert!(text.contains("`z` is not finite"), "{text}");
    }
    let companion =
        "[gap.companion]\nuse = \"equations\"\nobserve = \"a + w\"\nfixed = { w = inf }\n";
    let text = checked("1.5", companion);
    assert!(text.contains("`w` is not finite"), "{text}");
}

/// Sizes that only the plugin knows to need memory.
#[test]
fn sizes_of_plugins_are_refused_where_they_stand() {
    // The smallest of these needs 190 GB.
    if lacuna::text::memory::of_machine().is_none_or(|memory| memory > 1.8e11) {
        return;
    }
    let text = "[study]\ntitle = \"line\"\n[[parameter]]\nname = \"a\"\nunit = \"mm/s\"\n\
                prior = { uniform = [0, 4] }\n[[parameter]]\nname = \"b\"\nunit = \"mm\"\n\
                prior = { uniform = [-1, 1] }\n[response]\nname = \"y\"\nunit = \"mm\"\n\
                axes = { time = { first = 0.1, last = 1, count = 10, unit = \"s\" } }\n\
                [model]\nuse = \"equations\"\nobserve = \"a * time + b\"\n\
                [design]\nuse = \"latin_hypercube\"\nruns = 30\n[surrogate]\n\
                use = \"polynomial_chaos\"\ndegree = 2\n[[quantity]]\nname = \"q\"\n\
                use = \"maximum\"\n[[reliability]]\nname = \"p\"\nquantity = \"q\"\nabove = 2.2\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    for (method, key) in [
        ("subset_simulation", "samples"),
        ("importance_sampling", "batch"),
        ("active_kriging", "samples"),
        ("active_kriging", "final_samples"),
    ] {
        let complaints = |size: usize| {
            fs::write(&path, format!("{text}use = \"{method}\"\n{key} = {size}\n")).unwrap();
            load_for(&path, &[], Use::Check).complaints()
        };
        assert_eq!(complaints(5000), "", "{method}");
        let found = complaints(2_000_000_000);
        assert!(found.contains("the samples need"), "{method}: {found}");
        assert!(found.contains(key) && found.contains("found 2000000000"), "{method}: {found}");
    }
    let folder = quick::simulated();
    let path = folder.path().join("study.toml");
    for (sampler, what) in [
        (
            "use=\"parallel_tempering\",temperatures=2000000000",
            "the walkers of all temperatures need",
        ),
        ("use=\"variational\",draws=2000000000", "the draws need"),
    ] {
        let found = load_for(&path, &[format!("sampler={{{sampler}}}")], Use::Check).complaints();
        assert!(found.contains(what), "{sampler}: {found}");
    }
}

/// Parts that fit into the memory of this machine one by one, and not together.
#[test]
fn memory_is_compared_with_all_parts_together() {
    let Some(memory) = lacuna::text::memory::of_machine() else { return };
    let folder = quick::simulated();
    let path = folder.path().join("study.toml");
    // Three parameters and sixty outputs, which are held twice while runs are read.
    let runs = (0.6 * memory / (8.0 * 123.0)).floor();
    let complaints = |settings: &[String]| load_for(&path, settings, Use::Check).complaints();
    let one = format!("design.runs={runs}");
    assert_eq!(complaints(std::slice::from_ref(&one)), "");
    let text = complaints(&[one, format!("design.extended=[{}]", runs - 1.0)]);
    assert!(text.contains("the study needs"), "{text}");
    assert!(
        text.contains("the largest part: the runs") && text.contains("`design.runs`"),
        "{text}"
    );
    assert!(text.contains("this machine has"), "{text}");
}

/// The files of a run are compared with the disk before it begins.
#[test]
fn files_are_compared_with_the_free_disk() {
    let folder = quick::simulated();
    let study = quick::load(&folder.path().join("study.toml"), &[]);
    // 40 runs of 63 numbers; three copies of 24 x 60 draws of four numbers.
    assert_eq!(fits_on_disk(&study, 2e5), Ok(()));
    let text = fits_on_disk(&study, 1e5).unwrap_err();
    assert_eq!(
        text,
        "the study writes 158 kB, and 100 kB are free; the largest part: the draws, 138 kB (`sampler.steps`)"
    );
}

#[test]
fn check_tells_the_memory_of_a_large_study() {
    let folder = quick::simulated();
    let check = |setting: &str| {
        let mut lacuna = quick::command();
        let output = lacuna.arg("check").arg(folder.path().join("study.toml"));
        let output = output.args(["--set", setting]).output().unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(!check("sampler.steps=60").contains("memory"));
    // Four numbers of 24 walkers at each step, twice, beside 40 runs and the measurements.
    let text = check("sampler.steps=100000");
    assert!(
        text.contains(
            "needs 154 MB of memory; the largest part: the draws, 154 MB (`sampler.steps`)"
        ),
        "{text}"
    );
}

/// An interpreter that leaves a file behind when it is started.
#[cfg(unix)]
#[test]
fn check_starts_no_program_that_a_study_names() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let trace = folder.path().join("trace");
    let program = folder.path().join("interpreter");
    fs::write(&program, format!("#!/bin/sh\ntouch {}\n", trace.display())).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    fs::write(folder.path().join("model.py"), "def simulate(a):\n    return a\n").unwrap();
    let study = |function: &str| {
        format!(
            "[study]\ntitle = \"x\"\n[[parameter]]\nname = \"a\"\nprior = {{ uniform = [0, 1] }}\n\
             [response]\nname = \"y\"\n[model]\nuse = \"python\"\nfile = \"model.py\"\n\
             function = \"{function}\"\ninterpreter = \"./interpreter\"\n[design]\nuse = \"random\"\n\
             runs = 20\n[surrogate]\nuse = \"polynomial_chaos\"\ndegree = 1\n"
        )
    };
    let path = folder.path().join("study.toml");
    fs::write(&path, study("simulate")).unwrap();
    let text = load_for(&path, &[], Use::Check).complaints();
    assert_eq!(text, "");
    fs::write(&path, study("simulat")).unwrap();
    let text = load_for(&path, &[], Use::Check).complaints();
    assert!(text.contains("model.py has no function `simulat`"), "{text}");
    assert!(text.contains("did you mean `simulate`?"), "{text}");
    assert!(!trace.exists(), "check has started the interpreter");
    load_for(&path, &[], Use::Run);
    assert!(trace.exists(), "the interpreter of this test leaves no trace");
}

/// A model on a server, alone and as a part of a chain, and derivatives that it is asked for.
#[test]
fn check_contacts_no_server() {
    let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    server.set_nonblocking(true).unwrap();
    let path = quick::root().join("configs/um_bridge/study.toml");
    let settings = |gradients: &str| {
        let url = format!("model.url=\"http://{}\"", server.local_addr().unwrap());
        let surrogate =
            format!("surrogate={{use=\"polynomial_chaos\",degree=1,gradients={gradients}}}");
        [url, "design={use=\"random\",runs=20}".to_owned(), surrogate]
    };
    for gradients in ["false", "true"] {
        let checked = load_for(&path, &settings(gradients), Use::Check);
        assert!(checked.study.is_some(), "{}", checked.complaints());
    }
    let heard = server.accept().map(|(_, from)| from);
    assert!(heard.is_err(), "{heard:?} asked the server");
}

/// A truth of 1e9 known to about 0.1, for which the report must still be written.
#[test]
fn a_posterior_that_is_narrow_against_its_mean_has_a_report() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    let text = "[study]\ntitle = \"narrow\"\n[[parameter]]\nname = \"frequency\"\n\
                prior = { uniform = [9e8, 1.1e9] }\n[target]\nuse = \"expression\"\n\
                log_density = \"sum(normal_log_density(y, frequency * t, 1))\"\n\
                data = { t = [1, 2, 3, 4], y = [1e9, 2e9, 3e9, 4e9] }\n\
                [sampler]\nuse = \"affine_invariant_ensemble\"\nwalkers = 40\nsteps = 300\n";
    fs::write(&path, text).unwrap();
    let begun = Instant::now();
    let out = folder.path().join("run");
    quick::run(&path, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    assert!(begun.elapsed().as_secs_f64() < 60.0, "{:?}", begun.elapsed());
    let found = &quick::summary(&out)["parameters"]["frequency"];
    // Closed form: a normal posterior with mean 1e9 and variance 1 / sum(t^2).
    let exact = 1.0 / 30.0_f64.sqrt();
    let [mean, sd] = ["mean", "sd"].map(|key| found[key].as_f64().unwrap());
    assert!((sd / exact - 1.0).abs() < 0.2, "{sd} {exact}");
    assert!((mean - 1e9).abs() < 0.3 * exact, "{mean}");
}

/// The time of an event in seconds since 1970, known to a millisecond: a sum of the draws keeps no millisecond. Closed form: a
/// normal posterior about the mean of the three readings.
#[test]
fn the_mean_of_a_time_keeps_its_milliseconds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    let text = "[study]\ntitle = \"event\"\n[[parameter]]\nname = \"t0\"\n\
                prior = { uniform = [1.6e9, 1.8e9] }\n[target]\nuse = \"expression\"\n\
                log_density = \"sum(normal_log_density(y, t0, 0.001))\"\n\
                data = { y = [1700000000.123, 1700000000.124, 1700000000.122] }\n\
                [sampler]\nuse = \"adaptive_metropolis\"\nsteps = 40000\n";
    fs::write(&path, text).unwrap();
    let out = folder.path().join("run");
    quick::run(&path, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    let found = &quick::summary(&out)["parameters"]["t0"];
    let of = |key: &str| found[key].as_f64().unwrap();
    let exact = 0.001 / 3.0_f64.sqrt();
    assert!((of("mean") - 1_700_000_000.123).abs() < 4.0 * of("mcse_mean"), "{found}");
    // The relative error of a standard deviation from n effective draws is 1 / √(2 n).
    let error = (2.0 * of("ess_bulk")).powf(-0.5);
    assert!((of("sd") / exact - 1.0).abs() < 4.0 * error, "{found} {exact}");
}

/// Independent exponential distributions within bounds: a mode in a corner of many dimensions, with a mean in closed
/// form. Methods of every kind start there, including those that draw their own starting points.
#[test]
fn a_mode_in_a_corner_stops_no_sampler() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    for active in [2, 5, 10] {
        let names: Vec<String> = (0..active).map(|j| format!("x{j}")).collect();
        let priors: String = names
            .iter()
            .map(|name| {
                format!("[[parameter]]\nname = \"{name}\"\nprior = {{ uniform = [0, 1] }}\n")
            })
            .collect();
        // The rates are 20, 30, 40, ...
        let terms: Vec<String> =
            names.iter().enumerate().map(|(j, name)| format!("{} * {name}", 20 + 10 * j)).collect();
        for sampler in [
            "use = \"affine_invariant_ensemble\"\nwalkers = 60\nsteps = 3000",
            "use = \"no_u_turn\"\nchains = 4\nsteps = 1500\nwarm_up = 500",
            "use = \"sequential_monte_carlo\"\nparticles = 500",
            "use = \"nested\"\nlive = 400",
        ] {
            let text = format!(
                "[study]\ntitle = \"corner\"\n{priors}[target]\nuse = \"expression\"\n\
                 log_density = \"-({})\"\n[sampler]\n{sampler}\n",
                terms.join(" + ")
            );
            // In ten coordinates this number of live points is too small for the mean of each.
            if active == 10 && sampler.contains("nested") {
                continue;
            }
            fs::write(&path, text).unwrap();
            let out = folder.path().join(format!("run{active}"));
            quick::run(&path, &[], &out)
                .unwrap_or_else(|stop| panic!("{active} bounds, {sampler}: {stop}"));
            let summary = quick::summary(&out);
            for (j, name) in names.iter().enumerate() {
                let rate = 20.0 + 10.0 * j as f64;
                // Mean of an exponential distribution truncated to (0, 1): 1 / rate - 1 / (exp(rate) - 1).
                let exact = 1.0 / rate - 1.0 / rate.exp_m1();
                let found = &summary["parameters"][name];
                let [mean, sd, size] =
                    ["mean", "sd", "ess_bulk"].map(|key| found[key].as_f64().unwrap());
                let error = sd / size.max(50.0).sqrt();
                assert!(
                    (mean - exact).abs() < 5.0 * error,
                    "{active} bounds, {sampler}, {name}: {mean} and not {exact} with {error}"
                );
            }
        }
    }
}

/// `resolved.toml` holds the folder of a study as text.
#[cfg(unix)]
#[test]
fn a_folder_that_no_file_can_name_is_refused() {
    use std::os::unix::ffi::OsStrExt as _;

    let folder = quick::tables();
    let study = fs::read_to_string(folder.path().join("study.toml")).unwrap();
    let odd = folder.path().join(std::ffi::OsStr::from_bytes(b"a\xffb"));
    fs::create_dir(&odd).unwrap();
    let text = load_text(&odd.join("study.toml"), &study, &[]).complaints();
    assert!(text.contains("the study lies in a folder whose name is not UTF-8"), "{text}");
}

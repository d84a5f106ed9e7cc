//! Quantities predicted by several studies in one.

use lacuna_engine::compare::{Finished, compare};

use super::{number, section, written};
use crate::quick;

/// The mean of a mixture is the weighted mean of the printed means, and its second moment that of the second moments.
#[test]
fn a_mixture_has_the_moments_of_the_weighted_studies() {
    let (folder, _) = written(&section("middle", "at", "place = 3.5"));
    let path = folder.path().join("study.toml");
    let folders = ["a", "b"].map(|name| folder.path().join(name));
    for (out, variance) in folders.iter().zip([0.25, 0.3]) {
        let setting = format!("discrepancy.variance={{ known = {variance} }}");
        quick::run(&path, &[&setting], out).unwrap_or_else(|stop| panic!("{stop}"));
    }
    let runs = folders.each_ref().map(|out| Finished::read(out).unwrap());
    let compared = compare(&runs);
    let weights: Vec<f64> = compared.runs.iter().map(|run| run.pseudo_bma.unwrap()).collect();
    // The data do not decide: both studies count.
    assert!(weights.iter().all(|w| *w > 0.05), "{weights:?}");
    let moments = folders.each_ref().map(|out| {
        let found = &quick::summary(out)["quantities"]["middle"];
        let draws = number(found, "/draws");
        let [mean, sd] = ["/mean", "/sd"].map(|key| number(found, key));
        [mean, mean * mean + sd * sd * (draws - 1.0) / draws]
    });
    let of = |k: usize| weights.iter().zip(&moments).map(|(w, m)| w * m[k]).sum::<f64>();
    let mixed = &compared.mixed[0];
    assert_eq!(mixed.name, "middle");
    let spread = mixed.pseudo_bma.unwrap();
    assert!((spread.mean - of(0)).abs() < 1e-9, "{spread:?} {moments:?}");
    assert!((spread.sd - (of(1) - of(0).powi(2)).sqrt()).abs() < 1e-6, "{spread:?} {moments:?}");
    // A run whose predictions cannot be read is not left out in silence.
    std::fs::remove_file(folders[0].join("6-quantities/draws.nc")).unwrap();
    let said = Finished::read(&folders[0]).unwrap_err().to_string();
    assert!(said.contains("draws.nc"), "{said}");
}

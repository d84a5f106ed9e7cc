//! A dry friction under a disturbance that no candidate is: a flexible form of friction describes a part of the
//! disturbance, and the simple one is named all the same. The truth is integrated here, by the classical Runge-Kutta
//! method.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;

use generator::noise::Source;
use lacuna::run::Silent;
use lacuna_engine::gap::search::VerdictKind;
use lacuna_run::RunDirectory;

use super::inside::loaded;
use super::single::STUDY;

/// The coefficient of the friction, in m/s².
const DRY: f64 = 0.35;

/// The acceleration of the drive of [`STUDY`] with dry friction, in m/s².
fn acceleration(v: f64, t: f64) -> f64 {
    1.5 * (TAU * 0.3 * t).sin() - 0.9 * v - DRY * (v / 2e-3).tanh()
}

/// The positions of the drive from rest at 200 times, in m.
fn positions() -> Vec<f64> {
    const H: f64 = 2.5e-4;
    let (mut x, mut v, mut out) = (0.0, 0.0, Vec::new());
    for k in 0..40_000 {
        let t = H * f64::from(k);
        let first = acceleration(v, t);
        let second = acceleration(v + 0.5 * H * first, t + 0.5 * H);
        let third = acceleration(v + 0.5 * H * second, t + 0.5 * H);
        let fourth = acceleration(v + H * third, t + H);
        x += H * v + H * H / 6.0 * (first + second + third);
        v += H / 6.0 * (first + 2.0 * second + 2.0 * third + fourth);
        if (k + 1) % 200 == 0 {
            out.push(x);
        }
    }
    out
}

/// The sensor swings by 4 mm with a rising frequency: four standard deviations of the noise.
#[test]
fn dry_friction_keeps_its_name_under_a_disturbance() {
    let mut random = Source::new(1);
    let mut csv = "replicate,t [s],x [m]\n".to_owned();
    for (i, x) in positions().into_iter().enumerate() {
        let t = 0.05 * (i + 1) as f64;
        let disturbance = 4e-3 * (0.7 * t + 0.05 * t * t).sin();
        writeln!(csv, "0,{t},{}", x + disturbance + 1e-3 * random.normal()).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("data.csv"), csv).unwrap();
    let noise = "noise = { sd = 0.001, memory = 0 }";
    let study = loaded(&folder, &STUDY.replace("NOISE", noise));
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    let result = findings.gap.unwrap().result;
    let kinds: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
    let found = (result.verdict.word, &kinds[..]);
    assert_eq!(
        found,
        (VerdictKind::Approximate, &["coulomb_friction"][..]),
        "{:?}",
        result.verdict
    );
    let size = &result.additions[0].unknowns[0];
    // The disturbance is no noise, so that the standard deviation does not hold; the friction is right within a tenth.
    assert!((size.value - DRY).abs() < 0.1 * DRY, "{size:?}");
}

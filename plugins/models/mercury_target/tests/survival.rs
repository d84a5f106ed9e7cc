//! All values in the calibration's ranges give finite traces or a stated error.

use super::*;

/// Halton's sequence (1960) in base `b`: evenly distributed points without random numbers.
fn halton(mut index: u32, base: u32) -> f64 {
    let (mut value, mut share) = (0.0, 1.0);
    while index > 0 {
        share /= f64::from(base);
        value += share * f64::from(index % base);
        index /= base;
    }
    value
}

fn check(target: &Target, mercury: &Mercury) -> Outcome {
    let outcome = target.simulate(mercury).unwrap();
    assert_eq!(outcome.strain.len(), 10);
    assert!(outcome.strain.iter().all(|trace| trace.len() == 100));
    assert!(outcome.strain.iter().flatten().all(|x| x.is_finite()), "{mercury:?}");
    assert_eq!(outcome.valid, outcome.largest_volumetric_strain < 0.1);
    assert!(outcome.energy.imbalance().abs() < 0.03, "{mercury:?} {:?}", outcome.energy);
    assert!(outcome.cavitated_fraction.iter().all(|share| (0.0..=1.0).contains(share)));
    assert!(outcome.saturation_time <= outcome.times[99] * (1.0 + 1e-9));
    outcome
}

fn target(load: Load) -> Target {
    let mut settings = Settings::default();
    settings.pulse.load = load;
    Target::new(&settings).unwrap()
}

#[test]
fn survives_the_design_box() {
    for (load, offset) in [(Load::ThermalStrain, 0), (Load::FixedPressure, 40)] {
        let target = target(load);
        for k in 1..=40 {
            let k = k + offset;
            check(
                &target,
                &Mercury {
                    density: 1350.0 + (13_600.0 - 1350.0) * halton(k, 2),
                    sound_speed: 1e4 * halton(k, 3),
                    tensile_cutoff: 1.5e7 * halton(k, 5),
                },
            );
        }
    }
}

#[test]
fn survives_the_corners() {
    let mut refused = 0;
    for load in [Load::ThermalStrain, Load::FixedPressure] {
        let target = target(load);
        for density in [1350.0, 13_600.0] {
            for sound_speed in [0.0, 1.0, 10.0, 1e4] {
                for tensile_cutoff in [0.0, 1.5e7] {
                    let mercury = Mercury { density, sound_speed, tensile_cutoff };
                    refused += u32::from(!check(&target, &mercury).valid);
                }
            }
        }
    }
    assert!(refused > 8, "soft fluids under a fixed pressure leave small strains: {refused}");
}

#[test]
fn riemers_values_give_strains_like_the_published_ones() {
    let outcome = check(&target(Load::ThermalStrain), &RIEMER);
    assert!(outcome.valid);
    for trace in &outcome.strain {
        let peak = trace.iter().copied().fold(0.0, f64::max);
        assert!((100e-6..360e-6).contains(&peak), "{peak}");
    }
    // Near gauges have early peaks, far gauges late ones: T before V and R.
    let time = |gauge: usize| {
        let trace = &outcome.strain[gauge];
        (0..100).max_by(|&a, &b| trace[a].total_cmp(&trace[b])).unwrap()
    };
    assert!(time(5) < time(7) && time(5) < time(4));
    assert!(outcome.cavitated_fraction.iter().copied().fold(0.0, f64::max) > 0.5);
}

#[test]
fn runs_repeat_bit_by_bit() {
    let settings = Settings::default();
    let target = Target::new(&settings).unwrap();
    let first = target.simulate(&RIEMER).unwrap();
    assert_eq!(first, target.simulate(&RIEMER).unwrap());
    assert_eq!(first, simulate(&settings, &RIEMER).unwrap());
}

#[test]
fn input_without_meaning_is_refused_by_name() {
    let message = |change: fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        simulate(&settings, &RIEMER).unwrap_err().to_string()
    };
    assert_eq!(
        message(|s| s.wall.poisson_ratio = 0.5),
        "`wall.poisson_ratio` is 0.5; it must be in [0, 0.5)"
    );
    assert!(message(|s| s.geometry.radius = f64::NAN).starts_with("`geometry.radius` is NaN"));
    assert!(message(|s| s.geometry.length = 0.04).starts_with("`geometry.length`"));
    assert!(message(|s| s.numerics.mesh = Cells::Explicit([1, 90])).contains("[1, 90]"));
    assert!(message(|s| s.gauges.0[1].position = 0.6).contains("position of gauge C"));
    assert_eq!(message(|s| s.gauges.0[1].name = "B".into()), "two gauges are named `B`");
    assert!(message(|s| s.gauges.0.clear()).starts_with("`gauges` is empty"));
    assert!(message(|s| s.sampling.count = 0).contains("sampling.count"));
    assert!(message(|s| s.sampling.interval = 1e3).contains("time steps"));
    let refused = |mercury: Mercury| simulate(&Settings::default(), &mercury).unwrap_err();
    for mercury in [
        Mercury { density: 0.0, ..RIEMER },
        Mercury { sound_speed: -1.0, ..RIEMER },
        Mercury { tensile_cutoff: f64::INFINITY, ..RIEMER },
    ] {
        assert!(matches!(refused(mercury), SimulationError::Settings(_)));
    }
    let endless = refused(Mercury { sound_speed: 1e12, ..RIEMER });
    assert!(matches!(endless, SimulationError::TooManySteps { .. }));
}

#[test]
fn settings_read_from_text() {
    let text = r#"{"numerics": {"mesh": [12, 50], "rear": "rigid"}, "pulse": {"load":
        "fixed_pressure"}, "gauges": [{"name": "A", "place": "cap", "position": 0.02,
        "angle": 0}]}"#;
    let settings: Settings = serde_json::from_str(text).unwrap();
    assert_eq!(settings.numerics.mesh.counts(), [12, 50]);
    assert_eq!(settings.numerics.cfl, 0.7);
    assert_eq!(settings.gauges.0[0].length, 0.0127);
    assert_eq!(simulate(&settings, &RIEMER).unwrap().strain.len(), 1);
    let named: Settings = serde_json::from_str(r#"{"numerics": {"mesh": "fine"}}"#).unwrap();
    assert_eq!(named.numerics.mesh.counts(), [40, 180]);
    let wrong = serde_json::from_str::<Settings>(r#"{"numerics": {"mesh": "finer"}}"#);
    assert!(wrong.unwrap_err().to_string().contains("[radial cells, axial cells]"));
    let unknown = serde_json::from_str::<Settings>(r#"{"gauge": []}"#);
    assert!(unknown.unwrap_err().to_string().contains("unknown field `gauge`"));
    let schema = serde_json::to_string(&schemars::schema_for!(Settings)).unwrap();
    assert!(schema.contains("Peak initial pressure"));
    let default = serde_json::to_string(&Settings::default()).unwrap();
    assert_eq!(serde_json::from_str::<Settings>(&default).unwrap(), Settings::default());
}

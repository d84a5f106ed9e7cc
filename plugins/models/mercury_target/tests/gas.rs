//! A pulse in mercury with gas: effects of the gas on the strains, and their limits.

use super::*;

fn of_cells(cells: [usize; 2]) -> Target {
    let mut settings = Settings::default();
    settings.numerics.mesh = Cells::Explicit(cells);
    Target::new(&settings).unwrap()
}

fn coarse() -> Target {
    of_cells([10, 45])
}

fn with(void_fraction: f64, bubble_radius: f64) -> Gas {
    Gas { void_fraction, bubble_radius, ..Gas::default() }
}

fn run(target: &Target, void_fraction: f64, bubble_radius: f64) -> Outcome {
    target.simulate_with_gas(&RIEMER, &with(void_fraction, bubble_radius)).unwrap()
}

/// Peak-to-peak strain, mean over the gauges.
fn swing(outcome: &Outcome) -> f64 {
    let of = |trace: &Vec<f64>| {
        let ends = |(low, high): (f64, f64), &x: &f64| (low.min(x), high.max(x));
        let (low, high) = trace.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends);
        high - low
    };
    outcome.strain.iter().map(of).sum::<f64>() / outcome.strain.len() as f64
}

#[test]
fn little_gas_changes_little() {
    // The effect is smaller than that of the mesh and within the scatter of the closures.
    let target = coarse();
    let base = target.simulate(&RIEMER).unwrap();
    for radius in [0.0, 5e-5] {
        let change = rms_difference(&run(&target, 1e-9, radius), &base);
        assert!(change < 2e-6, "{change}");
    }
}

#[test]
fn bubbles_without_size_are_in_equilibrium() {
    let target = coarse();
    for void_fraction in [1e-4, 4e-4] {
        let equilibrium = run(&target, void_fraction, 0.0);
        let small = run(&target, void_fraction, 1e-8);
        let change = rms_difference(&equilibrium, &small);
        assert!(change < 1e-7, "{change}");
    }
}

#[test]
fn more_gas_leaves_less_strain() {
    let target = coarse();
    for radius in [0.0, 5e-5, 5e-4] {
        let swings = [0.0, 3e-5, 1e-4, 2e-4, 4e-4, 1e-3].map(|a| swing(&run(&target, a, radius)));
        assert!(swings.windows(2).all(|pair| pair[1] < pair[0]), "{swings:?}");
    }
}

#[test]
fn strains_fall_by_as_much_as_was_measured_at_the_facility() {
    // McClintock et al., Materials & Design (2022) 110937: gas injection reduced the strain of the vessel by 25 to 75
    // %. The default gas between 1e-4 and 4e-4 covers the middle of that range.
    let target = Target::new(&Settings::default()).unwrap();
    let base = swing(&target.simulate(&RIEMER).unwrap());
    let Gas { bubble_radius, .. } = Gas::default();
    for radius in [0.0, bubble_radius] {
        let loss = |a| 1.0 - swing(&run(&target, a, radius)) / base;
        let (least, middle, most) = (loss(1e-4), loss(2e-4), loss(4e-4));
        assert!((0.10..0.25).contains(&least), "{least}");
        assert!((0.25..0.50).contains(&middle), "{middle}");
        assert!((0.50..0.75).contains(&most), "{most}");
    }
}

#[test]
fn energy_never_rises_and_the_relaxation_only_takes() {
    let target = coarse();
    let vessel = target.vessel();
    let constants = FluidConstants {
        linear_viscosity: 0.25,
        quadratic_viscosity: 1.2,
        hourglass: 0.01,
        ..INVISCID
    };
    let dt = 0.7 * vessel.stable_step(RIEMER.sound_speed, constants.linear_viscosity);
    for (share, radius) in [(1e-4, 0.0), (1e-3, 0.0), (1e-4, 1e-5), (4e-4, 5e-5), (1e-3, 5e-4)] {
        let Mercury { density, sound_speed, tensile_cutoff } = RIEMER;
        let initial = target.initial_pressure(&RIEMER);
        let cells = initial.len();
        let liquid = TensileCutoff::new(density, sound_speed, tensile_cutoff, initial);
        let bubbles = with(share, radius).bubbles(density);
        let law = Bubbly::new(liquid, bubbles, vec![share; cells]);
        let mut solver = Solver::new(vessel, constants, law, dt);
        let stored = |e: &EnergyBalance| e.kinetic + e.fluid + e.wall;
        let mut before = solver.energy();
        for _ in 0..60 {
            for _ in 0..20 {
                solver.step();
            }
            let now = solver.energy();
            assert!(stored(&now) <= stored(&before), "{now:?}");
            // In equilibrium the loss after the pulse is the error of the step.
            let error = if radius == 0.0 { 5e-4 * now.start } else { 0.0 };
            assert!(now.relaxed >= before.relaxed - error, "{now:?}");
            assert!(now.viscous < now.start && now.relaxed < now.start, "{now:?}");
            assert!(now.imbalance().abs() < 0.015, "{now:?}");
            before = now;
        }
        assert!(radius == 0.0 || before.relaxed > 0.1 * before.start, "{before:?}");
    }
}

#[test]
fn every_loss_is_accounted_for_with_damping_too() {
    let mut settings = Settings { damping: 500.0, ..Settings::default() };
    settings.numerics.mesh = Cells::Explicit([10, 45]);
    let target = Target::new(&settings).unwrap();
    let undamped = swing(&run(&coarse(), 1e-4, 5e-5));
    let outcome = run(&target, 1e-4, 5e-5);
    let energy = outcome.energy;
    assert!(energy.imbalance().abs() < 0.015 && energy.damped > 0.0, "{energy:?}");
    assert!(swing(&outcome) < undamped);
    let linear = Mercury { tensile_cutoff: 1e12, ..RIEMER };
    let energy = target.simulate(&linear).unwrap().energy;
    assert!(energy.imbalance().abs() < 1e-4 && energy.damped > 0.0, "{energy:?}");
}

#[test]
fn survives_the_extremes() {
    let target = of_cells([6, 24]);
    let (mut far, mut soft) = (RIEMER, RIEMER);
    (far.density, far.sound_speed, far.tensile_cutoff) = (1350.0, 1e4, 1.5e7);
    (soft.sound_speed, soft.tensile_cutoff) = (10.0, 0.0);
    let still = Mercury { sound_speed: 0.0, ..RIEMER };
    let tense = Mercury { tensile_cutoff: 1.5e7, ..RIEMER };
    for mercury in [far, soft, still, tense, RIEMER] {
        for void_fraction in [1e-9, 1e-3, 0.05] {
            for bubble_radius in [0.0, 5e-5, 0.01] {
                for (ambient_pressure, polytropic_index) in [(1e3, 1.0), (3e5, 1.4), (1e8, 2.0)] {
                    let gas = Gas {
                        ambient_pressure,
                        polytropic_index,
                        ..with(void_fraction, bubble_radius)
                    };
                    let outcome = target.simulate_with_gas(&mercury, &gas).unwrap();
                    let energy = outcome.energy;
                    assert!(outcome.strain.iter().flatten().all(|x| x.is_finite()), "{gas:?}");
                    assert!(energy.imbalance().abs() < 0.03, "{mercury:?} {gas:?} {energy:?}");
                }
            }
        }
    }
}

#[test]
fn stratified_gas_is_where_it_should_be() {
    let geometry = Geometry::default();
    let gas = Gas { void_fraction: 1e-3, gradient: 0.6, depletion: 0.8, ..Gas::default() };
    let (a, length) = (geometry.radius, gas.depletion_length);
    let at = |r: f64, depth: f64| gas.share(&geometry, r, geometry.nose(r) + depth) / 1e-3;
    assert!((at(0.0, 1.0) - 0.4).abs() < 1e-6 && (at(a, 1.0) - 1.6).abs() < 1e-6);
    assert!((at(0.0, 0.0) - 0.4 * 0.2).abs() < 1e-9);
    assert!((at(a, length) - 1.6 * (1.0 - 0.8 / 1f64.exp())).abs() < 1e-9);
    // The mean over a cross section is the void fraction.
    let rings = 1000;
    let mean: f64 = (0..rings)
        .map(|k| {
            let x = (f64::from(k) + 0.5) / f64::from(rings);
            at(a * x, 2.0) * 2.0 * x / f64::from(rings)
        })
        .sum();
    assert!((mean - 1.0).abs() < 1e-5, "{mean}");
    // Gas that is missing at the window reduces the effect on the gauges near it.
    let target = coarse();
    let depleted = Gas { depletion: 1.0, depletion_length: 0.1, ..with(2e-4, 5e-5) };
    let even = run(&target, 2e-4, 5e-5);
    let missing = target.simulate_with_gas(&RIEMER, &depleted).unwrap();
    assert!(swing(&missing) > swing(&even));
}

#[test]
fn gas_without_meaning_is_refused_by_name() {
    let target = coarse();
    let message = |change: fn(&mut Gas)| {
        let mut gas = Gas::default();
        change(&mut gas);
        target.simulate_with_gas(&RIEMER, &gas).unwrap_err().to_string()
    };
    assert_eq!(
        message(|g| g.void_fraction = -0.1),
        "`void_fraction` is -0.1; it must be in [0, 1)"
    );
    assert_eq!(message(|g| g.gradient = 2.0), "`void_gradient` is 2; it must be in [-1, 1]");
    assert!(message(|g| g.depletion = f64::NAN).starts_with("`void_depletion` is NaN"));
    assert!(message(|g| g.ambient_pressure = 0.0).ends_with("it must be a positive number"));
    assert!(message(|g| g.polytropic_index = 0.9).ends_with("it must be at least 1"));
}

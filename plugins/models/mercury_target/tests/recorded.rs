//! The model without gas reproduces its results from before gas was added, to the last bit.

use super::*;

/// Hash of Fowler, Noll and Vo (FNV-1a) of all strains' bits.
fn hash(outcome: &Outcome) -> u64 {
    let fold = |hash: u64, x: &f64| (hash ^ x.to_bits()).wrapping_mul(0x0100_0000_01b3);
    outcome.strain.iter().flatten().fold(0xcbf2_9ce4_8422_2325, fold)
}

/// The bits depend on the platform's `exp`, hence the test runs on one platform only.
#[cfg(all(target_arch = "x86_64", target_os = "linux", target_env = "gnu"))]
#[test]
fn pure_mercury_is_what_it_was() {
    let target = Target::new(&Settings::default()).unwrap();
    let mercury =
        |density, sound_speed, tensile_cutoff| Mercury { density, sound_speed, tensile_cutoff };
    // Recorded from the version before gas was added.
    for (mercury, strains, saturation, viscous) in [
        (RIEMER, 0xc0e2_159b_2712_bc7c, 0x3f4f_e19f_4455_f408, 0x4018_f5a7_3307_ac7e),
        (
            mercury(12_112.1, 1850.4, 6.45e4),
            0x4c3e_4b65_8775_1cfa,
            0x3f50_0bf3_5feb_2f60,
            0x4021_e03b_1768_305b,
        ),
        (
            mercury(1350.0, 1e4, 1.5e7),
            0xb1e4_610c_c35f_a3bf,
            0x3f07_51af_1c08_542e,
            0x4042_df64_9cc2_b090,
        ),
    ] {
        let outcome = target.simulate(&mercury).unwrap();
        let found =
            (hash(&outcome), outcome.saturation_time.to_bits(), outcome.energy.viscous.to_bits());
        assert_eq!(found, (strains, saturation, viscous), "{mercury:?}");
    }
}

#[test]
fn gas_of_no_volume_changes_nothing() {
    let settings = Settings::default();
    let target = Target::new(&settings).unwrap();
    let base = target.simulate(&RIEMER).unwrap();
    for bubble_radius in [0.0, 5e-5] {
        let gas = Gas { void_fraction: 0.0, bubble_radius, ..Gas::default() };
        assert_eq!(target.simulate_with_gas(&RIEMER, &gas).unwrap(), base);
    }
    let tense = Mercury { tensile_cutoff: 0.0, ..RIEMER };
    let gas = Gas { void_fraction: 0.0, ..Gas::default() };
    assert_eq!(target.simulate_with_gas(&tense, &gas).unwrap(), target.simulate(&tense).unwrap());
}

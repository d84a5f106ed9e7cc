//! Physics that the models of the systems may lack.

use super::Missing;
use super::law::Law::{
    self, Cogging, Constant, DeadZone, Drooping, Evaporation, Exponential, Hole, Hysteresis, Loss,
    OneSided, Overflow, Radiation, Stiffness, Stop, Stribeck,
};
use super::system::{AROUND, EXCESS, Kind};

type Types = &'static [&'static str];

const DRAG: Types = &[
    "linear_friction",
    "quadratic_friction",
    "coulomb_friction",
    "power_friction",
    "stribeck_friction",
    "dahl_friction",
    "carreau_friction",
];
const SPRING: Types = &["cubic_stiffness", "quadratic_stiffness", "power_stiffness"];
const POWER: Types = &["power_friction"];

/// Missing physics of the form of these types of terms.
fn form(name: &'static str, laws: &[(Law, f64)], exact: Types, near: Types) -> Missing {
    Missing { name, laws: laws.to_vec(), exact, near }
}

/// Missing physics of the form of no term, but nearly of these types.
fn outside(name: &'static str, law: Law, share: f64, near: Types) -> Missing {
    form(name, &[(law, share)], &[], near)
}

/// Physics that a model of a system may lack, the first one nothing; the coefficients are shares of the root mean square
/// of the rate.
pub fn missing(kind: Kind) -> Vec<Missing> {
    let mut all = vec![form("nothing", &[], &[], &[])];
    all.extend(match kind {
        Kind::Pendulum => pendulum(),
        Kind::Drive => drive(),
        Kind::Cooling => cooling(),
        Kind::Tanks => tanks(),
        Kind::Fall => fall(),
        Kind::Driven => driven(),
        Kind::Free => free(),
    });
    all
}

fn pendulum() -> Vec<Missing> {
    let both: &[(Law, f64)] = &[(Loss(0.0), 0.01), (Loss(2.0), 0.02)];
    vec![
        form("dry friction", &[(Loss(0.0), 0.02)], &["coulomb_friction"], DRAG),
        form("square drag", &[(Loss(2.0), 0.03)], &["quadratic_friction"], DRAG),
        form(
            "dry friction and square drag",
            both,
            &["coulomb_friction", "quadratic_friction"],
            DRAG,
        ),
        form("drag of power 1.5", &[(Loss(1.5), 0.03)], POWER, DRAG),
        form("drag of power 0.5", &[(Loss(0.5), 0.02)], POWER, DRAG),
        outside("drooping drag", Drooping, 0.03, DRAG),
    ]
}

fn drive() -> Vec<Missing> {
    const BOTH: Types = &["coulomb_friction", "constant_rate"];
    let both: &[(Law, f64)] = &[(Loss(0.0), 0.1), (Constant, 0.05)];
    vec![
        form("offset", &[(Constant, 0.05)], &["constant_rate"], &[]),
        form("dry friction and offset", both, BOTH, BOTH),
        form("falling friction", &[(Stribeck, 0.15)], &["stribeck_friction"], DRAG),
        outside("cogging", Cogging, 0.1, &[]),
    ]
}

fn cooling() -> Vec<Missing> {
    const HEAT: Types = &["evaporation", "radiation", "convection", "carreau_friction"];
    const BOTH: Types = &["evaporation", "constant_rate"];
    let both: &[(Law, f64)] = &[(Evaporation(0.4), 0.05), (Constant, 0.1)];
    vec![
        form("evaporation", &[(Evaporation(0.4), 0.05)], &["evaporation"], HEAT),
        form("radiation", &[(Radiation(AROUND / EXCESS), 0.2)], &["radiation"], HEAT),
        form("evaporation and a heater", both, BOTH, BOTH),
        form("convection of power 1.25", &[(Loss(1.25), 0.3)], &["convection"], HEAT),
        outside("drooping loss", Drooping, 0.3, HEAT),
    ]
}

fn tanks() -> Vec<Missing> {
    const LEAK: Types = &["linear_friction", "quadratic_friction", "overflow", "power_friction"];
    vec![
        form("overflow", &[(Overflow, 1.5)], &["overflow"], &[]),
        form("a leak", &[(Loss(1.0), 0.2)], &["linear_friction"], LEAK),
        form("a leak of power 1.5", &[(Loss(1.5), 0.2)], POWER, LEAK),
        outside("a hole at a height", Hole, 0.3, LEAK),
    ]
}

fn fall() -> Vec<Missing> {
    vec![
        form("square drag", &[(Loss(2.0), 0.15)], &["quadratic_friction"], DRAG),
        form("linear drag", &[(Loss(1.0), 0.15)], &["linear_friction"], DRAG),
        form("drag of power 1.5", &[(Loss(1.5), 0.15)], POWER, DRAG),
        outside("drooping drag", Drooping, 0.15, DRAG),
    ]
}

fn driven() -> Vec<Missing> {
    const GAP: Types = &["dead_zone", "cubic_stiffness", "power_stiffness"];
    const LOOP: Types = &["bouc_wen", "dahl_friction", "coulomb_friction", "maxwell_damping"];
    vec![
        form("cubic stiffness", &[(Stiffness(3.0), 0.1)], &["cubic_stiffness"], SPRING),
        form("one-sided stiffness", &[(OneSided, 0.1)], &["quadratic_stiffness"], SPRING),
        form("stiffness of power 5", &[(Stiffness(5.0), 0.05)], &["power_stiffness"], SPRING),
        form("dead zone", &[(DeadZone, 0.15)], &["dead_zone"], GAP),
        outside("exponential stiffness", Exponential, 0.05, SPRING),
        outside("hysteresis", Hysteresis, 0.15, LOOP),
    ]
}

fn free() -> Vec<Missing> {
    const STOP: Types = &["overflow", "quadratic_stiffness", "limiter"];
    vec![
        form("square drag", &[(Loss(2.0), 0.05)], &["quadratic_friction"], DRAG),
        form("dry friction", &[(Loss(0.0), 0.02)], &["coulomb_friction"], DRAG),
        form("a stop", &[(Stop, 0.3)], &["overflow"], STOP),
        form("drag of power 1.5", &[(Loss(1.5), 0.05)], POWER, DRAG),
        form("softening of power 2", &[(Stiffness(2.0), -0.08)], &["power_stiffness"], SPRING),
    ]
}

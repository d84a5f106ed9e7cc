//! Integration tests, in one binary: it is linked once, and its tests share the cores until the last one ends. The tests that
//! register plugins (`contracts.rs`) or load libraries of them (`dynamic.rs`) have binaries of their own, because the
//! registry is that of a process.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod assess;
mod bad_input;
mod browser;
mod campaign;
mod celsius;
mod commands;
#[cfg(unix)]
mod compiled;
mod convert;
mod coverage;
mod cut;
mod dependencies;
mod direct;
mod docs;
mod effects;
mod emulator_file;
mod events;
mod falling_balls;
mod faulty_tables;
mod fidelity;
mod fields;
mod forced_oscillator;
mod forward;
mod fuzz;
mod gap;
mod gate;
mod gradients;
#[cfg(unix)]
mod header;
mod hierarchy;
mod intervals;
mod kill;
mod left_out;
#[cfg(target_os = "linux")]
mod long_tables;
mod made_by;
mod predict;
mod priors;
mod problems;
mod python;
mod quantities;
mod quick;
mod readme;
mod refused;
mod reliability;
mod revisions;
mod schema;
mod screening;
mod sequential;
mod skeletons;
mod slurm;
mod spread;
mod starts;
mod stated_noise;
mod stochastic;
mod studies;
mod tidy;
mod truth;
mod um_bridge;
mod view;
mod what_people_bring;
mod worked;

//! Tests of the whole, in one binary.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod assess;
mod bad_input;
mod campaign;
mod commands;
mod docs;
mod effects;
mod falling_balls;
mod faulty_tables;
mod fidelity;
mod forced_oscillator;
mod kill;
mod left_out;
mod made_by;
mod problems;
mod python;
mod quick;
mod readme;
mod refused;
mod revisions;
mod skeletons;
mod slurm;
mod stated_noise;
mod studies;
mod tidy;
mod um_bridge;
mod what_people_bring;
mod worked;

//! A companion of the pipe: pressure heads and flows on a staggered grid, with terms that the pipe may lack.
//!
//! The leapfrog scheme with a Courant number below one disperses waves, which the method of characteristics does not: the
//! companion is wrong where waves are steep.

use std::f64::consts::PI;

/// Cells of the pipe.
const CELLS: usize = 50;

const LENGTH: f64 = 1000.0;
const GRAVITY: f64 = 9.81;

/// Time between samples, s, and samples.
const SAMPLE: f64 = 0.08;
const SAMPLES: usize = 120;

/// The Courant number.
const COURANT: f64 = 0.8;

/// Gauges: places from the reservoir, as shares of the length.
const GAUGES: [f64; 6] = [0.15, 0.35, 0.5, 0.7, 0.875, 1.0];

/// Places between gauges at which something may be, as shares of the length.
pub const BETWEEN: [f64; 8] = [0.1, 0.22, 0.3, 0.43, 0.55, 0.64, 0.78, 0.94];

/// The inputs: names, the values without which the companion has no answer, and what they are. The first four are those of
/// the pipe.
pub const INPUTS: [(&str, f64, &str); 35] = [
    ("wave_speed", f64::NAN, "speed of waves, m/s"),
    ("friction", f64::NAN, "friction factor of Darcy and Weisbach"),
    ("velocity", f64::NAN, "initial velocity, m/s"),
    ("closure", f64::NAN, "time of closure, s"),
    ("head", 100.0, "head of the reservoir, m"),
    ("stretch", 1.0, "factor of the wave speed"),
    ("unsteady_friction", 0.0, "further inertia of the flow, as a share"),
    ("linear_friction", 0.0, "further friction, 1/s"),
    ("creep", 0.0, "creeping share of the compliance of the wall, over 0.5 s"),
    ("friction_power", 0.0, "two less the power of the flow in the friction"),
    ("valve_leak", 0.0, "opening that the closed valve keeps"),
    ("leak_1", 0.0, "area of a leak at 0.1 of the length, as a share of the pipe's"),
    ("leak_2", 0.0, "area of a leak at 0.22 of the length, as a share of the pipe's"),
    ("leak_3", 0.0, "area of a leak at 0.3 of the length, as a share of the pipe's"),
    ("leak_4", 0.0, "area of a leak at 0.43 of the length, as a share of the pipe's"),
    ("leak_5", 0.0, "area of a leak at 0.55 of the length, as a share of the pipe's"),
    ("leak_6", 0.0, "area of a leak at 0.64 of the length, as a share of the pipe's"),
    ("leak_7", 0.0, "area of a leak at 0.78 of the length, as a share of the pipe's"),
    ("leak_8", 0.0, "area of a leak at 0.94 of the length, as a share of the pipe's"),
    ("throttle_1", 0.0, "loss at 0.1 of the length, in velocity heads"),
    ("throttle_2", 0.0, "loss at 0.22 of the length, in velocity heads"),
    ("throttle_3", 0.0, "loss at 0.3 of the length, in velocity heads"),
    ("throttle_4", 0.0, "loss at 0.43 of the length, in velocity heads"),
    ("throttle_5", 0.0, "loss at 0.55 of the length, in velocity heads"),
    ("throttle_6", 0.0, "loss at 0.64 of the length, in velocity heads"),
    ("throttle_7", 0.0, "loss at 0.78 of the length, in velocity heads"),
    ("throttle_8", 0.0, "loss at 0.94 of the length, in velocity heads"),
    ("air_1", 0.0, "air at 0.1 of the length, m3"),
    ("air_2", 0.0, "air at 0.22 of the length, m3"),
    ("air_3", 0.0, "air at 0.3 of the length, m3"),
    ("air_4", 0.0, "air at 0.43 of the length, m3"),
    ("air_5", 0.0, "air at 0.55 of the length, m3"),
    ("air_6", 0.0, "air at 0.64 of the length, m3"),
    ("air_7", 0.0, "air at 0.78 of the length, m3"),
    ("air_8", 0.0, "air at 0.94 of the length, m3"),
];

/// The samples of all gauges in turn, m, for the values of [`INPUTS`]; the first condition closes the valve, the second
/// throttles it.
pub fn response(inputs: &[f64], condition: usize) -> Vec<f64> {
    let get = |name: &str| {
        let place = INPUTS.iter().position(|(own, ..)| *own == name);
        place.map_or(f64::NAN, |place| inputs[place])
    };
    let area = PI * 0.25 * 0.25;
    let speed = get("wave_speed") * get("stretch");
    let dx = LENGTH / CELLS as f64;
    let step = SAMPLE / (SAMPLE * speed / (COURANT * dx)).ceil();
    let start = get("velocity") * area;
    let slope = get("friction") / (2.0 * GRAVITY * 0.5 * area * area);
    let mut parts = vec![[0.0; 3]; CELLS];
    for (k, x) in BETWEEN.iter().enumerate() {
        let names = ["leak", "throttle", "air"].map(|name| get(&format!("{name}_{}", k + 1)));
        parts[(x * CELLS as f64) as usize] = names;
    }
    let (less, head0) = (get("friction_power"), get("head"));
    let (creep, valve_leak) = (get("creep"), get("valve_leak"));
    let (inertia, linear) = (1.0 + get("unsteady_friction"), get("linear_friction"));
    // Heads in the middles of cells, flows at their faces.
    let mut head: Vec<f64> =
        (0..CELLS).map(|i| head0 - (i as f64 + 0.5) * dx * slope * start * start).collect();
    let mut crept = vec![0.0; CELLS];
    let mut flow = vec![start; CELLS + 1];
    let end = head0 - LENGTH * slope * start * start;
    let mut valve = end;
    let steps = (SAMPLE / step).round() as usize;
    let mut curves = vec![Vec::with_capacity(SAMPLES); GAUGES.len()];
    for sample in 0..SAMPLES {
        for sub in 0..if sample == 0 { 0 } else { steps } {
            let time = SAMPLE * (sample - 1) as f64 + step * (sub + 1) as f64;
            for i in 0..CELLS {
                let [leak, _, air] = parts[i];
                let out = leak * area * (2.0 * GRAVITY * head[i].max(0.0)).sqrt();
                let gas = air * (head0 + 10.0) / (head[i] + 10.0).max(0.5).powi(2);
                let compliance = GRAVITY * area * dx / (speed * speed);
                let creeping = creep * compliance * (head[i] - head0) - crept[i];
                let creeping = creeping * (1.0 - (-step / 0.5).exp());
                crept[i] += creeping;
                head[i] += (step * (flow[i] - flow[i + 1] - out) - creeping) / (compliance + gas);
            }
            let rate = |i: usize, gradient: f64, q: f64| {
                let scale = (q.abs() / start).max(1e-9).powf(-less);
                let lost = if i < CELLS { parts[i][1] } else { 0.0 };
                let throttle = lost / (2.0 * GRAVITY * area * area * dx);
                let friction = (slope * scale + throttle) * q * q.abs();
                (-GRAVITY * area * (gradient + friction) - linear * q) / inertia
            };
            flow[0] += step * rate(CELLS, (head[0] - head0) / (0.5 * dx), flow[0]);
            for i in 1..CELLS {
                flow[i] += step * rate(i, (head[i] - head[i - 1]) / dx, flow[i]);
            }
            // The valve with the wave that arrives at it.
            let b = speed / (GRAVITY * area);
            let arrives = head[CELLS - 1] + b * 0.5 * (flow[CELLS - 1] + flow[CELLS]);
            let open = opening(condition, time, get("closure")).max(valve_leak);
            let c = (open * start).powi(2) / (2.0 * end);
            let out = -b * c + ((b * c).powi(2) + 2.0 * c * arrives.max(0.0)).sqrt();
            flow[CELLS] = out;
            valve = arrives - b * out;
        }
        for (curve, share) in curves.iter_mut().zip(GAUGES) {
            let at = share * CELLS as f64 - 0.5;
            let k = (at.floor() as usize).min(CELLS - 1);
            let next = head.get(k + 1).copied().unwrap_or(valve);
            let part = if k + 1 < CELLS { at - k as f64 } else { 2.0 * (at - k as f64) };
            curve.push(head[k] * (1.0 - part) + next * part);
        }
    }
    curves.concat()
}

/// The opening of the valve: closed once, or closed by half and opened again.
fn opening(condition: usize, time: f64, closure: f64) -> f64 {
    match condition {
        0 => (1.0 - time / closure).max(0.0).powf(1.5),
        _ => 1.0 - 0.35 * (1.0 - (2.0 * PI * time / (3.0 * closure)).cos()),
    }
}

//! Studies of single records: the equations of a system without the missing physics.

use std::fmt::Write as _;

use generator::single::{Kind, Record, Stated};

/// The equations of a system and the unit of its response.
fn equations(kind: Kind) -> (&'static str, &'static str) {
    match kind {
        Kind::Pendulum => (
            r#"state = { x = "release", v = { start = 0.0, unit = "1/s" } }
rate = { x = "v", v = "-stiffness * sin(x) - damping * v" }"#,
            "1",
        ),
        Kind::Drive => (
            r#"state = { x = { start = 0.0, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
rate = { x = "v", v = "force * sin(2 * pi * 0.3 {1/s} * t) - damping * v" }"#,
            "m",
        ),
        Kind::Cooling => (
            r#"state = { x = "begin" }
rate = { x = "-loss * (x - 293 {K})" }"#,
            "K",
        ),
        Kind::Tanks => (
            r#"state = { x = "begin", y = { start = 0.8, unit = "1" } }
rate = { x = "pump * (1 + 0.5 * sin(2 * pi * t / 13 {s})) - outlet * sqrt(x)", y = "outlet * (sqrt(x) - sqrt(y))" }"#,
            "1",
        ),
        Kind::Fall => (
            r#"state = { x = "height", v = "velocity" }
rate = { x = "v", v = "-gravity" }"#,
            "m",
        ),
        Kind::Driven => (
            r#"state = { x = "begin", v = { start = 0.0, unit = "m/s" } }
rate = { x = "v", v = "force * cos(2 * pi * 0.3 {1/s} * t) - damping * v - stiffness * x" }"#,
            "m",
        ),
        Kind::Free => (
            r#"state = { x = "begin", v = { start = 0.0, unit = "m/s" } }
rate = { x = "v", v = "-damping * v - stiffness * x" }"#,
            "m",
        ),
    }
}

/// The key `noise` with what a data sheet says.
fn noise(stated: &Stated) -> String {
    let Stated { sd, resolution, memory } = stated;
    let step =
        if *resolution > 0.0 { format!(", resolution = {resolution:e}") } else { String::new() };
    format!("noise = {{ sd = {sd:e}{step}, memory = {memory:e} }}\n")
}

/// The study of a record, whose values are in `data.csv`; `stated` is what it says about its instrument.
pub fn study(record: &Record, stated: Option<&Stated>) -> String {
    let (model, unit) = equations(record.system.kind);
    let mut text = "[study]\ntitle = \"a record\"\nseed = 7\n".to_owned();
    for p in record.system.parameters() {
        let _ = write!(
            text,
            "\n[[parameter]]\nname = \"{}\"\nunit = \"{}\"\nprior = {{ normal = [{:e}, {:e}] }}\n",
            p.name,
            if p.unit.is_empty() { "1" } else { p.unit },
            p.middle,
            p.width()
        );
    }
    let (first, last, count) =
        (record.times[0], record.times[record.times.len() - 1], record.times.len());
    let _ = write!(
        text,
        r#"
[response]
name = "x"
unit = "{unit}"
axes = {{ t = {{ first = {first:e}, last = {last:e}, count = {count}, unit = "s" }} }}

[model]
use = "equations"
{model}
observe = "x"

[measurements]
use = "csv"
path = "data.csv"
{}
[discrepancy]
use = "gaussian"
variance = {{ half_normal = {:e} }}

[sampler]
use = "no_u_turn"
warm_up = 40
steps = 60
"#,
        stated.map(noise).unwrap_or_default(),
        (0.1 * record.spread).powi(2),
    );
    text
}

/// The table of the measured values.
pub fn table(record: &Record) -> String {
    let mut csv = format!("replicate,t [s],x [{}]\n", equations(record.system.kind).1);
    let (first, last) = (record.times[0], record.times[record.times.len() - 1]);
    let step = (last - first) / (record.times.len() - 1) as f64;
    for (i, y) in record.values.iter().enumerate() {
        let _ = writeln!(csv, "0,{},{y}", first + step * i as f64);
    }
    csv
}

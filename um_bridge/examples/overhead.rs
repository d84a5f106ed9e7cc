//! Cost of a request: evaluates a model of a server at one point, many times.
//!
//! `overhead URL MODEL COUNT SIZES CONFIG VALUE...`, such as
//! `overhead http://localhost:4242 rod 2000 2,1 '{"positions": [10, 66]}' -18.4 0.0019 2.37`

use std::time::{Duration, Instant};

use lacuna_um_bridge::Client;
use lacuna_um_bridge::protocol::About;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [url, model, count, sizes, config, values @ ..] = arguments.as_slice() else {
        return Err("expected URL MODEL COUNT SIZES CONFIG VALUE...".into());
    };
    let client = Client::new(url, Duration::from_secs(60), 0);
    let about = About { name: model.clone(), config: serde_json::from_str(config)? };
    let mut values = values.iter().map(|text| text.parse());
    let mut input = Vec::new();
    for size in sizes.split(',') {
        let vector: Result<Vec<f64>, _> = values.by_ref().take(size.parse()?).collect();
        input.push(vector?);
    }
    let count: u32 = count.parse()?;
    client.evaluate(&about, &input)?;
    let begun = Instant::now();
    for _ in 0..count {
        client.evaluate(&about, &input)?;
    }
    let each = begun.elapsed() / count;
    println!("{:.3} ms an evaluation", 1e3 * each.as_secs_f64());
    Ok(())
}

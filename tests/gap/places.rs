//! A bump on one sensor under one condition is located correctly.

use generator::{Kind, SAMPLES, STEP};
use lacuna_engine::gap::test::Region;

use super::cases::{Asked, Plan, asked, count};

/// Samples in which the bump is not negligible, by curve: two conditions of four sensors.
fn truth(asked: &Asked) -> Vec<bool> {
    let hidden = &asked.case.hidden[0];
    let [begin, width, condition] = hidden.shape;
    let mut cells = vec![false; 8 * SAMPLES];
    let curve = 4 * condition as usize + hidden.sensors[0];
    for (i, cell) in cells[curve * SAMPLES..][..SAMPLES].iter_mut().enumerate() {
        let t = STEP * i as f64;
        *cell = begin < t && t < begin + width;
    }
    cells
}

fn cells(regions: &[Region]) -> Vec<bool> {
    let mut cells = vec![false; 8 * SAMPLES];
    for region in regions {
        let (begin, end) = region.cell.window;
        for curve in &region.curves {
            cells[curve * SAMPLES + begin..=curve * SAMPLES + end].fill(true);
        }
    }
    cells
}

/// Intersection over union of two sets of samples.
fn overlap(a: &[bool], b: &[bool]) -> f64 {
    let both = a.iter().zip(b).filter(|(a, b)| **a && **b).count();
    let either = a.iter().zip(b).filter(|(a, b)| **a || **b).count();
    both as f64 / either as f64
}

/// Requirement: a mean intersection over union of sensor and time of 0.55 at the noise of one replicate. The bound is
/// four standard errors of the mean lower; a single overlap has a standard deviation of at most 0.2.
#[test]
fn a_bump_is_found_where_it_is() {
    let plan = |i: u64| {
        let kinds = vec![(Kind::Burst, vec![(i % 4) as usize])];
        Plan { replicates: 8, ..Plan::new(i, kinds, 1.0) }
    };
    let all = asked(6, (0..count(40, 3)).map(plan).collect());
    let overlaps: Vec<f64> =
        all.iter().map(|a| overlap(&truth(a), &cells(&a.answer.regions))).collect();
    let n = overlaps.len() as f64;
    let mean = overlaps.iter().sum::<f64>() / n;
    let variance = overlaps.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (variance / n).sqrt();
    println!("\n### A bump, rms 1\n\nmean overlap {mean:.3} ± {error:.3} of {n} cases");
    for (asked, overlap) in all.iter().zip(&overlaps).filter(|(_, o)| **o < 0.4) {
        let found: Vec<_> =
            asked.answer.regions.iter().map(|r| (&r.curves, r.cell.window)).collect();
        println!("missed: {overlap:.2} {:?} {found:?}", asked.case.hidden[0]);
    }
    assert!(mean > 0.55 - 4.0 * 0.2 / n.sqrt(), "{mean} ± {error}");
}

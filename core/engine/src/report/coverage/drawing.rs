//! Figures of the ranks: histogram, and difference of their distribution function from the uniform one.

use lacuna::diagnose::coverage::{Row, ranks};

use crate::page::chart::{Axis, Frame, PANEL};
use crate::page::drawing::{Datum, Drawing};
use crate::page::number::significant;
use crate::page::svg::{Anchor, Area, Path, Svg};

const HEIGHT: f64 = 190.0;
/// Number of bars, each over the same number of ranks.
const BARS: usize = 20;

/// Draws the ranks of one unknown: how many fall into each twentieth, and the difference between their distribution
/// function and the uniform one, each with the band that a uniform sample leaves with a probability of 1 %.
pub fn ranks_of(row: &Row, band: &ranks::Band) -> [Drawing; 2] {
    [histogram(row), differences(row, band)]
}

/// Rectangle inside the axes of a panel.
fn area() -> Area {
    Area::new(58.0, 24.0, PANEL - 68.0, HEIGHT - 62.0)
}

fn histogram(row: &Row) -> Drawing {
    let mut svg = Svg::new(PANEL, HEIGHT);
    let counts = ranks::histogram(&row.ranks, BARS);
    let [low, high] =
        lacuna::diagnose::coverage::binomial::band(row.ranks.len(), 1.0 / BARS as f64, 0.005);
    let top = counts.iter().copied().max().unwrap_or(0).max(high) as f64 * 1.1 + 1.0;
    let area = area();
    let (x, y) =
        (Axis::new("rank, as a share", (0.0, 1.0)), Axis::new("truths", (0.0, top)).ticks(4));
    let frame = Frame::new(area, &x, &y);
    frame.axes(&mut svg, &x, &y);
    let ends = |k: usize| [(0.0, k as f64), (1.0, k as f64)];
    let (upper, lower) = (frame.along(&ends(high)), frame.along(&ends(low)));
    svg.path("s-band", &Path::band(&upper, &lower), "");
    for (i, &count) in counts.iter().enumerate() {
        let from = frame.at((i as f64 / BARS as f64, count as f64));
        let to = frame.at(((i + 1) as f64 / BARS as f64, 0.0));
        let bar = Area::new(from.0 + 1.0, from.1, to.0 - from.0 - 2.0, to.1 - from.1);
        svg.rectangle("bar s-part", bar, &format!("{count}"));
    }
    svg.text("panel-title", (1.0, 14.0), Anchor::Start, &row.name);
    let outside = counts.iter().filter(|&&count| count < low || count > high).count();
    let words = format!(
        "ranks of the truth of {} among posterior draws: {outside} of {BARS} bars lie outside the 99 % band",
        row.name
    );
    let values = counts.iter().enumerate().map(|(i, &count)| {
        Datum::point(&row.name, "truths", ((i as f64 + 0.5) / BARS as f64, count as f64))
    });
    Drawing::panel(svg.finish(&words), ["rank, as a share", "truths"], values.collect())
}

fn differences(row: &Row, band: &ranks::Band) -> Drawing {
    let mut svg = Svg::new(PANEL, HEIGHT);
    let n = (row.ranks.len() as f64).max(1.0);
    let side = |k: usize| -> Vec<(f64, f64)> {
        band.points.iter().zip(&band.counts).map(|(&z, c)| (z, c[k] as f64 / n - z)).collect()
    };
    let count = |z: f64| row.ranks.iter().filter(|&&r| r <= z + 1e-12).count() as f64;
    let own: Vec<(f64, f64)> = band.points.iter().map(|&z| (z, count(z) / n - z)).collect();
    let (lower, upper) = (side(0), side(1));
    let all = lower.iter().chain(&upper).chain(&own);
    let most = all.map(|point| point.1.abs()).fold(0.05, f64::max) * 1.1;
    let x = Axis::new("rank, as a share", (0.0, 1.0));
    let y = Axis::new("ECDF difference", (-most, most)).ticks(4);
    let frame = Frame::new(area(), &x, &y);
    frame.axes(&mut svg, &x, &y);
    svg.text("panel-title", (1.0, 14.0), Anchor::Start, &row.name);
    svg.path("s-band", &Path::band(&frame.along(&upper), &frame.along(&lower)), "");
    svg.line("line s-equal", frame.at((0.0, 0.0)), frame.at((1.0, 0.0)));
    svg.path("line s-map", &Path::through(frame.along(&own)), "");
    let largest = own.iter().map(|point| point.1.abs()).fold(0.0, f64::max);
    let words = format!(
        "distribution of the ranks of {} less the uniform one: largest difference {}",
        row.name,
        significant(largest, 2)
    );
    let values = own.iter().map(|&point| Datum::point(&row.name, "difference", point)).collect();
    Drawing::panel(svg.finish(&words), ["rank, as a share", "ECDF difference"], values)
}

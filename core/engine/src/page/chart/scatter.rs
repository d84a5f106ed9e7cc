//! Simulated against emulated values, with the line of agreement.

use super::{Axis, Frame, WIDTH};
use crate::page::scale::{extent, padded};
use crate::page::svg::{Area, Path, Svg};

/// Draws pairs `(simulated, emulated)` in the displayed unit, with the line on which both are equal.
pub fn agreement(pairs: &[(f64, f64)], labels: (&str, &str), description: &str) -> String {
    let height = 420.0;
    let side = height - 60.0;
    let left = (WIDTH - side) / 2.0;
    let domain = extent(pairs.iter().flat_map(|&(a, b)| [a, b])).unwrap_or((0.0, 1.0));
    let domain = padded(domain, 0.04);
    let (x, y) = (Axis::new(labels.0, domain), Axis::new(labels.1, domain));
    let frame = Frame::new(Area::new(left, 12.0, side, side), &x, &y);
    let mut svg = Svg::new(WIDTH, height);
    frame.axes(&mut svg, &x, &y);
    frame.inside(&mut svg, &x, &y, |svg| {
        svg.path("s-pair", &dots(&frame, pairs), "");
        let (low, high) = frame.x.domain();
        svg.path("line s-equal", &Path::through(frame.along(&[(low, low), (high, high)])), "");
    });
    svg.finish(description)
}

/// Many dots as one path of very short lines with round ends: a tenth of the file size of circles.
pub fn dots(frame: &Frame, points: &[(f64, f64)]) -> Path {
    Path::through(points.iter().flat_map(|&point| {
        let (x, y) = frame.at(point);
        [(x, y), (x + 0.1, y), (f64::NAN, f64::NAN)]
    }))
}

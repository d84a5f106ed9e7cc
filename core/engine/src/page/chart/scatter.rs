//! Simulated against emulated values, with the line of agreement.

use super::{Axis, Curve, Frame, PANEL, with_unit};
use crate::page::drawing::{Datum, Drawing};
use crate::page::number::{significant, typeset};
use crate::page::scale::{extent, padded};
use crate::page::svg::{Area, Path, Svg};

/// Draws pairs `(simulated, emulated)` in the displayed unit, with the line on which both are equal.
pub fn agreement(pairs: &[(f64, f64)], labels: (&str, &str), description: &str) -> Drawing {
    let domain = extent(pairs.iter().flat_map(|&(a, b)| [a, b])).unwrap_or((0.0, 1.0));
    let domain = padded(domain, 0.04);
    let (x, y) = (Axis::new(labels.0, domain).ticks(4), Axis::new(labels.1, domain));
    let off = pairs.iter().filter(|(a, b)| a.is_finite() && b.is_finite());
    let farthest = off.max_by(|p, q| (p.0 - p.1).abs().total_cmp(&(q.0 - q.1).abs()));
    let said = farthest.map_or_else(String::new, |(a, b)| {
        let [a, b] = [a, b].map(|v| typeset(&significant(*v, 3)));
        format!(
            ": the dot farthest off the line is {} where {}",
            with_unit(labels.1, &b),
            with_unit(labels.0, &a)
        )
    });
    let frame = Frame::new(Area::new(64.0, 12.0, PANEL - 74.0, PANEL - 74.0), &x, &y);
    let mut svg = Svg::new(PANEL, PANEL - 22.0);
    frame.axes(&mut svg, &x, &y);
    frame.inside(&mut svg, &x, &y, |svg| {
        svg.path("s-pair", &dots(&frame, pairs), labels.1.split(' ').next().unwrap_or_default());
        let (low, high) = frame.x.domain();
        svg.path("line s-equal", &Path::through(frame.along(&[(low, low), (high, high)])), "");
    });
    let values = pairs.iter().map(|&pair| Datum::point("", "", pair)).collect();
    Drawing::panel(svg.finish(&format!("{description}{said}")), [labels.0, labels.1], values)
}

/// Draws dots and lines over the full width; `name` is that of a dot.
pub fn dot_chart(
    points: &[(f64, f64)],
    lines: &[Curve],
    (x, y): (&Axis, &Axis),
    (name, description): (&str, &str),
) -> Drawing {
    let draw = |width: f64| {
        let area = Area::new(60.0, 12.0, width - 70.0, 180.0);
        let x = x.clone().ticks(if width > PANEL { x.ticks } else { x.ticks.min(4) });
        let frame = Frame::new(area, &x, y);
        let mut svg = Svg::new(width, 232.0);
        frame.axes(&mut svg, &x, y);
        frame.inside(&mut svg, &x, y, |svg| {
            svg.path("s-pair", &dots(&frame, points), name);
            for line in lines {
                let path = Path::through(frame.along(&line.points));
                svg.path(&format!("line {}", line.class), &path, &line.name);
            }
        });
        svg.finish(description)
    };
    let values = points.iter().map(|&point| Datum::point("", name, point)).collect();
    Drawing::wide(draw, [&x.label, &y.label], values)
}

/// Many dots as one path of very short lines with round ends: a tenth of the file size of circles.
pub fn dots(frame: &Frame, points: &[(f64, f64)]) -> Path {
    Path::through(points.iter().flat_map(|&point| {
        let (x, y) = frame.at(point);
        [(x, y), (x + 0.1, y), (f64::NAN, f64::NAN)]
    }))
}

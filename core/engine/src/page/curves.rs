//! Curves of a response as they are drawn: long records are reduced to their smallest and largest values.

use std::fmt::Write as _;

use lacuna::data::{Coordinates, Layouts, Unit};

use crate::page::number::count;
use crate::page::scale::ShownUnit;

/// Curves of a response, one panel per group.
pub struct Curves {
    /// Label of the horizontal axis.
    pub label: String,
    /// Range of the horizontal axis.
    pub domain: (f64, f64),
    /// Panels, one per group.
    pub panels: Vec<CurvePanel>,
    /// Number of groups that are not shown, for want of space.
    pub left_out: usize,
}

/// Places of the values of one panel.
pub struct CurvePanel {
    /// Name of the group.
    pub title: String,
    /// Abscissa and flat index of each value.
    pub places: Vec<(f64, usize)>,
    /// True if neighbouring values belong to one curve.
    pub connected: bool,
    /// Largest number of points of a drawn curve.
    most: usize,
}

/// Largest number of panels in one figure.
const MOST_PANELS: usize = 24;

impl Curves {
    /// Sentences on what the figure leaves out; empty if it shows everything.
    pub fn left_out_sentence(&self) -> String {
        let mut text = String::new();
        if self.left_out > 0 {
            let _ = write!(text, " {} further groups found no room.", self.left_out);
        }
        if let Some(longest) = self.panels.iter().map(CurvePanel::stretch).max().filter(|n| *n > 1)
        {
            let _ = write!(
                text,
                " Records are longer than a figure is wide: of every {} neighbouring values (fewer in shorter records) \
                 the smallest and the largest are drawn.",
                count(longest)
            );
        }
        text
    }

    /// Curves of the study's response; responses without a numeric axis share one panel.
    pub fn of(layouts: &Layouts) -> Self {
        let groups = layouts.groups();
        let Some((name, _, unit)) = layouts.blocks[0].abscissa() else {
            let places = (0..layouts.len()).map(|i| (i as f64 + 1.0, i)).collect();
            let panel = CurvePanel {
                title: layouts.name().to_owned(),
                places,
                connected: false,
                most: usize::MAX,
            };
            return Self {
                label: String::from("output [number in the study's order]"),
                domain: (0.5, layouts.len() as f64 + 0.5),
                panels: vec![panel],
                left_out: 0,
            };
        };
        let grids = || layouts.blocks.iter().filter_map(|block| Some(block.abscissa()?.1));
        let shown = ShownUnit::for_values(unit, grids().flatten().copied());
        let place = |flat: usize| {
            let (block, own) = layouts.block(flat);
            let at = block.axis(name).and_then(|(position, axis)| {
                let Coordinates::Grid { values, .. } = &axis.coordinates else { return None };
                Some(values[block.place(own)[position]])
            });
            (shown.show(at.unwrap_or(f64::NAN)), flat)
        };
        let most = if groups.len() == 1 { MOST_POINTS } else { MOST_POINTS / 2 };
        let panels = groups.iter().take(MOST_PANELS).map(|group| CurvePanel {
            title: group.name.clone(),
            places: group.indices.iter().copied().map(place).collect(),
            connected: true,
            most,
        });
        let first = grids().filter_map(|grid| grid.first()).copied().fold(f64::INFINITY, f64::min);
        let last =
            grids().filter_map(|grid| grid.last()).copied().fold(f64::NEG_INFINITY, f64::max);
        Self {
            label: shown.label(name),
            domain: (shown.show(first), shown.show(last)),
            panels: panels.collect(),
            left_out: groups.len().saturating_sub(MOST_PANELS),
        }
    }
}

/// Largest number of points of a curve as wide as the page: more points are less than a line width apart.
const MOST_POINTS: usize = 2000;

impl CurvePanel {
    /// Number of neighbouring values that are drawn as their smallest and largest; 1 if every value is drawn.
    fn stretch(&self) -> usize {
        if self.places.len() <= self.most { 1 } else { (2 * self.places.len()).div_ceil(self.most) }
    }

    /// The places, split where the abscissa starts again, and each piece split into stretches; true for the first
    /// stretch of a piece.
    fn stretches(&self) -> Vec<(bool, &[(f64, usize)])> {
        let mut found = Vec::new();
        for piece in self.places.chunk_by(|a, b| self.connected && a.0 < b.0) {
            let stretches = piece.chunks(self.stretch()).enumerate();
            found.extend(stretches.map(|(i, stretch)| (i == 0, stretch)));
        }
        found
    }

    /// Points of a curve, interrupted where the abscissa starts again or a value is missing.
    pub fn curve(&self, value: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let mut points = Vec::new();
        for (begins, stretch) in self.stretches() {
            if begins && !points.is_empty() {
                points.push((f64::NAN, f64::NAN));
            }
            let each = stretch.iter().map(|&(x, flat)| (x, value(flat)));
            if let [(x, flat)] = stretch {
                points.push((*x, value(*flat)));
            } else {
                points.extend(extremes(each));
            }
        }
        points
    }

    /// Edges of a band `(x, lower, upper)`, interrupted like [`Self::curve`].
    pub fn band(&self, edges: impl Fn(usize) -> Option<(f64, f64)>) -> Vec<(f64, f64, f64)> {
        let mut band = Vec::new();
        for (begins, stretch) in self.stretches() {
            if begins && !band.is_empty() {
                band.push((f64::NAN, f64::NAN, f64::NAN));
            }
            let known = stretch.iter().filter_map(|&(x, flat)| Some((x, edges(flat)?)));
            let widest = known.fold(None, |widest, (x, (low, high))| {
                let (first, lowest, highest) = widest.unwrap_or((x, low, high));
                Some((first, f64::min(lowest, low), f64::max(highest, high)))
            });
            band.push(widest.unwrap_or((stretch[0].0, f64::NAN, f64::NAN)));
        }
        band
    }
}

/// The smallest and the largest value, in the order of their abscissas; NaN if no value is finite.
fn extremes(values: impl Iterator<Item = (f64, f64)> + Clone) -> [(f64, f64); 2] {
    let known = || values.clone().filter(|(_, y)| y.is_finite());
    let by_value = |a: &(f64, f64), b: &(f64, f64)| a.1.total_cmp(&b.1);
    match (known().min_by(by_value), known().max_by(by_value)) {
        (Some(low), Some(high)) if low.0 <= high.0 => [low, high],
        (Some(low), Some(high)) => [high, low],
        _ => [(f64::NAN, f64::NAN); 2],
    }
}

/// Displayed unit of the last axis.
pub fn axis_unit(layouts: &Layouts) -> ShownUnit {
    let Some((_, grid, unit)) = layouts.blocks[0].abscissa() else {
        return ShownUnit::of(&Unit::dimensionless(), 1.0);
    };
    ShownUnit::for_values(unit, grid.iter().copied())
}

/// Displayed unit of frequencies along the last axis.
pub fn frequency_unit(layouts: &Layouts) -> ShownUnit {
    let abscissa = layouts.blocks[0].abscissa();
    let inverse = abscissa.and_then(|(_, _, unit)| unit.power(-1.0));
    let hertz = Unit::parse("Hz").ok().zip(Unit::parse("1/s").ok());
    let inverse = match (inverse, hertz) {
        (Some(inverse), Some((hertz, per_second))) if inverse == per_second => hertz,
        (inverse, _) => inverse.unwrap_or_default(),
    };
    let step = abscissa.map_or(1.0, |(_, grid, _)| match grid {
        [first, .., last] if grid.len() > 1 => (grid.len() - 1) as f64 / (last - first),
        _ => 1.0,
    });
    ShownUnit::for_values(&inverse, [0.1 * step])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_record_keeps_its_peaks() {
        let places = (0..100_001).map(|i| (f64::from(i), i as usize)).collect();
        let panel = CurvePanel { title: String::new(), places, connected: true, most: 1000 };
        let value = |i: usize| match i {
            31_417 => 5.0,
            31_418 => -7.0,
            _ => (1e-3 * i as f64).sin(),
        };
        let curve = panel.curve(value);
        assert!(curve.len() <= 1002, "{}", curve.len());
        assert!(curve.contains(&(31_417.0, 5.0)) && curve.contains(&(31_418.0, -7.0)));
        assert!(curve.windows(2).all(|pair| pair[0].0 <= pair[1].0));
        let band = panel.band(|i| Some((value(i) - 1.0, value(i) + 1.0)));
        let widest = band.iter().fold((0.0, 0.0), |w, b| (f64::min(w.0, b.1), f64::max(w.1, b.2)));
        assert_eq!(widest, (-8.0, 6.0));
        assert_eq!(panel.stretch(), 201);
    }

    #[test]
    fn a_short_record_is_drawn_as_it_is() {
        let places = vec![(0.0, 0), (1.0, 1), (0.5, 2), (1.5, 3)];
        let panel = CurvePanel { title: String::new(), places, connected: true, most: 10 };
        let curve = panel.curve(|i| i as f64);
        let gaps: Vec<bool> = curve.iter().map(|point| point.0.is_nan()).collect();
        assert_eq!(gaps, [false, false, true, false, false]);
        assert_eq!(curve[4], (1.5, 3.0));
    }
}

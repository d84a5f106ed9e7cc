//! Vertical bars, single or grouped, over names or numbers.

use super::{Axis, Frame};
use crate::page::drawing::{Datum, Drawing};
use crate::page::number::{fixed, significant, typeset};
use crate::page::svg::{Anchor, Area, Svg};

/// Bars of one kind, one bar per name.
#[derive(Debug, Clone, PartialEq)]
pub struct BarSeries {
    /// CSS class of the bars.
    pub class: &'static str,
    /// Label of the bars in hints and legend.
    pub name: String,
    /// Heights of the bars, one per name; a height that is not finite is not drawn.
    pub values: Vec<f64>,
}

/// Horizontal line across all bars.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// CSS class of the line.
    pub class: &'static str,
    /// Label of the line.
    pub label: String,
    /// Height of the line, in the unit of the vertical axis.
    pub value: f64,
}

/// Bar chart.
#[derive(Debug, Clone, PartialEq)]
pub struct BarChart {
    /// Names below the bars.
    pub names: Vec<String>,
    /// Series of bars, drawn side by side above each name.
    pub series: Vec<BarSeries>,
    /// Horizontal lines across the chart.
    pub levels: Vec<Level>,
    /// Label of the axis of names.
    pub x_label: String,
    /// Vertical axis.
    pub y: Axis,
    /// Indices of the names whose bars are highlighted.
    pub outstanding: Vec<usize>,
    /// True if each bar carries its value as a number.
    pub numbers: bool,
}

impl BarChart {
    /// Draws the chart; `description` is the text for readers who do not see it, to which the highest and the lowest
    /// bar are added.
    pub fn draw(&self, description: &str) -> Drawing {
        let words = format!("{description}: {}", self.in_words());
        let values = self.series.iter().flat_map(|series| {
            let each = self.names.iter().zip(&series.values);
            each.map(|(name, value)| Datum::named("", &series.name, name, *value))
        });
        let labels = [self.x_label.as_str(), self.y.label.as_str()];
        Drawing::wide(|width| self.sized(width, &words), labels, values.collect())
    }

    /// The highest and the lowest bar of each series.
    fn in_words(&self) -> String {
        let one = |series: &BarSeries| {
            let known = || {
                let each = self.names.iter().zip(&series.values);
                each.filter(|(_, value)| value.is_finite())
            };
            let by_value = |a: &(&String, &f64), b: &(&String, &f64)| a.1.total_cmp(b.1);
            let (low, high) = (known().min_by(by_value)?, known().max_by(by_value)?);
            let [low, high] = [low, high]
                .map(|(name, value)| format!("{} at {name}", typeset(&significant(*value, 3))));
            Some(format!("{} from {low} to {high}", series.name))
        };
        self.series.iter().filter_map(one).collect::<Vec<_>>().join("; ")
    }

    fn sized(&self, width: f64, description: &str) -> String {
        let height = 250.0;
        let area = Area::new(60.0, 20.0, width - 70.0, height - 64.0);
        let x = Axis::new(self.x_label.as_str(), (0.0, self.names.len().max(1) as f64)).ticks(0);
        let frame = Frame::new(area, &x, &self.y);
        let mut svg = Svg::new(width, height);
        frame.axes(&mut svg, &x, &self.y);
        self.draw_names(&mut svg, &frame);
        frame.inside(&mut svg, &x, &self.y, |svg| self.draw_bars(svg, &frame));
        // A number over a bar takes about five letters.
        if self.numbers && self.slot(&frame) > 34.0 * self.series.len() as f64 {
            self.draw_numbers(&mut svg, &frame);
        }
        for level in self.levels.iter().filter(|l| l.value.is_finite()) {
            let place = frame.y.place(level.value);
            svg.line(&format!("line {}", level.class), (area.x, place), (area.right(), place));
            let at = (area.right(), area.y - 6.0);
            svg.text(&format!("label {}", level.class), at, Anchor::End, &level.label);
        }
        svg.finish(description)
    }

    fn slot(&self, frame: &Frame) -> f64 {
        frame.area.width / self.names.len().max(1) as f64
    }

    /// Draws the names, as many as fit without overlapping.
    fn draw_names(&self, svg: &mut Svg, frame: &Frame) {
        let slot = self.slot(frame);
        let longest = self.names.iter().map(|n| n.chars().count()).max().unwrap_or(1);
        let stride = ((longest as f64 * 6.6 + 6.0) / slot).ceil().max(1.0) as usize;
        // Round strides (every 10th name, not every 7th) are easier to read.
        let stride = [1, 2, 5, 10, 20, 50].into_iter().find(|&s| s >= stride).unwrap_or(stride);
        // Counting from the stride gives 10, 20, 30 instead of 1, 11, 21.
        for (i, name) in self.names.iter().enumerate().skip(stride - 1).step_by(stride) {
            let at = (frame.area.x + (i as f64 + 0.5) * slot, frame.area.bottom() + 14.0);
            svg.text("tick", at, Anchor::Middle, name);
        }
    }

    fn bar(&self, frame: &Frame, series: usize, name: usize) -> Option<Area> {
        let value = *self.series[series].values.get(name)?;
        let slot = self.slot(frame);
        let gap = if slot > 8.0 { 0.24 } else { 0.1 };
        let width = slot * (1.0 - gap) / self.series.len() as f64;
        let left = frame.area.x + slot * (name as f64 + 0.5 * gap) + width * series as f64;
        let (top, zero) = (frame.y.place(value), frame.y.place(0.0));
        value.is_finite().then(|| Area::new(left, top.min(zero), width, (zero - top).abs()))
    }

    fn draw_bars(&self, svg: &mut Svg, frame: &Frame) {
        for (s, series) in self.series.iter().enumerate() {
            for (i, name) in self.names.iter().enumerate() {
                let Some(area) = self.bar(frame, s, i) else { continue };
                let value = typeset(&significant(series.values[i], 3));
                let hint = format!("{} {name}: {value}", series.name);
                let outstanding = if self.outstanding.contains(&i) { " outstanding" } else { "" };
                let class = format!("bar {}{outstanding}", series.class);
                // Bars that are narrower than a pixel cannot be pointed at.
                let hint = if area.width < 1.0 { "" } else { hint.trim_start() };
                svg.rectangle(&class, area, hint);
            }
        }
    }

    fn draw_numbers(&self, svg: &mut Svg, frame: &Frame) {
        let power = self.y.domain.1.log10().floor();
        let decimals = (2.0 - power).clamp(0.0, 9.0) as usize;
        for (s, series) in self.series.iter().enumerate() {
            for i in 0..self.names.len() {
                let Some(area) = self.bar(frame, s, i) else { continue };
                let text = typeset(&fixed(series.values[i], decimals));
                let at = (area.x + 0.5 * area.width, area.y - 4.0);
                svg.text("bar-number", at, Anchor::Middle, &text);
            }
        }
    }
}

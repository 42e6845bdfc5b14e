//! Curves as SVG, drawn by the service: they need no script, and colours come from the style sheet.

use super::words::whole;
use maud::{Markup, html};

/// Size of a drawing, in its own units. A page scales it to its column.
const SIZE: (f64, f64) = (480.0, 240.0);
/// Room for the labels: left, right, top, bottom.
const MARGINS: (f64, f64, f64, f64) = (56.0, 24.0, 14.0, 38.0);
/// Most points of one drawn curve: about one per unit of the drawing's width.
const DRAWN: usize = 400;
/// Ratio of the largest to the smallest value from which an axis is logarithmic where it may be.
const WIDE: f64 = 12.0;

/// A curve.
#[derive(Debug, Clone, Default)]
pub(crate) struct Series {
    /// x and y, in the order of x.
    pub points: Vec<(f64, f64)>,
    /// Whether it is one of earlier runs, which stand back.
    pub earlier: bool,
    /// Whether each point is marked, and the points are not connected.
    pub dots: bool,
}

/// Curves in one drawing.
#[derive(Debug, Clone)]
pub(crate) struct Chart<'a> {
    /// What is drawn.
    pub title: &'a str,
    /// What x is.
    pub x: &'a str,
    /// The curves; the last one is the one of interest.
    pub series: Vec<Series>,
    /// Decimals of y.
    pub decimals: usize,
    /// Whether x or y may be logarithmic.
    pub may_be_log: (bool, bool),
}

/// A linear or logarithmic axis.
struct Axis {
    low: f64,
    high: f64,
    log: bool,
}

impl Axis {
    /// The axis of `values`; `None` without any.
    fn of(values: impl Iterator<Item = f64>, may_be_log: bool) -> Option<Self> {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), it| {
            (low.min(it), high.max(it))
        });
        if low > high {
            return None;
        }
        let log = may_be_log && low > 0.0 && high / low > WIDE;
        if high > low {
            return Some(Self { low, high, log });
        }
        // One value stands in the middle.
        let around = 0.5_f64.max(low.abs() * 0.1);
        Some(Self {
            low: low - around,
            high: high + around,
            log: false,
        })
    }

    /// Where `value` is, from 0 to 1.
    fn at(&self, value: f64) -> f64 {
        match self.log {
            true => (value / self.low).ln() / (self.high / self.low).ln(),
            false => (value - self.low) / (self.high - self.low),
        }
    }

    /// Round values on the axis.
    fn ticks(&self) -> Vec<f64> {
        if self.log {
            let decades = (self.high / self.low).log10();
            let steps: &[f64] = if decades > 2.5 {
                &[1.0]
            } else {
                &[1.0, 2.0, 5.0]
            };
            let first = self.low.log10().floor() as i32;
            let last = self.high.log10().ceil() as i32;
            let all = (first..=last)
                .flat_map(|power| steps.iter().map(move |step| step * 10.0_f64.powi(power)));
            return all
                .filter(|it| (self.low..=self.high).contains(it))
                .collect();
        }
        let step = round_step((self.high - self.low) / 4.0);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last).map(|it| it as f64 * step).collect()
    }
}

/// The round number, 1, 2 or 5 times a power of ten, that is not below `step`.
fn round_step(step: f64) -> f64 {
    let power = 10.0_f64.powf(step.log10().floor());
    let mut round = [1.0, 2.0, 5.0].into_iter().map(|it| it * power);
    round
        .find(|it| *it >= step * (1.0 - 1e-9))
        .unwrap_or(10.0 * power)
}

/// `points` as at most [`DRAWN`] ones: means over parts of equal number.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let part = points.len().div_ceil(DRAWN).max(1);
    let mean = |part: &[(f64, f64)]| {
        let n = part.len() as f64;
        let sum = part
            .iter()
            .fold((0.0, 0.0), |sum, it| (sum.0 + it.0, sum.1 + it.1));
        (sum.0 / n, sum.1 / n)
    };
    points.chunks(part).map(mean).collect()
}

/// A number beside an axis: thousands as `12k`.
fn tick(value: f64) -> String {
    let size = value.abs();
    if size >= 10_000.0 {
        format!("{}k", trimmed(value / 1000.0, 1))
    } else if size >= 100.0 {
        trimmed(value, 0)
    } else if size >= 1.0 || size == 0.0 {
        trimmed(value, 2)
    } else if size >= 0.001 {
        trimmed(value, 4)
    } else {
        format!("{value:.0e}")
    }
}

/// `value` without zeros at the end of its decimals.
fn trimmed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// A coordinate: a tenth of a unit cannot be seen.
fn unit(value: f64) -> String {
    format!("{value:.1}")
}

impl Chart<'_> {
    /// The drawing, with its title above it; nothing without points.
    pub(crate) fn draw(&self) -> Markup {
        let finite = |it: &&(f64, f64)| it.0.is_finite() && it.1.is_finite();
        let known =
            |it: &Series| -> Vec<(f64, f64)> { it.points.iter().filter(finite).copied().collect() };
        let words = self.in_words(&self.series.last().map(known).unwrap_or_default());
        let series = self.series.iter().map(|it| (it, thinned(&known(it))));
        let series: Vec<(&Series, Vec<(f64, f64)>)> = series.collect();
        let all = || series.iter().flat_map(|(_, points)| points.iter());
        let axes = Axis::of(all().map(|it| it.0), self.may_be_log.0)
            .zip(Axis::of(all().map(|it| it.1), self.may_be_log.1));
        let Some((x, y)) = axes else {
            return html! {};
        };
        let (left, right, top, bottom) = MARGINS;
        let (width, height) = SIZE;
        let across = |value: f64| left + x.at(value) * (width - left - right);
        let up = |value: f64| height - bottom - y.at(value) * (height - top - bottom);
        let path = |points: &[(f64, f64)]| {
            let mut text = String::new();
            for (at, point) in points.iter().enumerate() {
                let command = if at == 0 { 'M' } else { 'L' };
                text += &format!("{command}{} {}", unit(across(point.0)), unit(up(point.1)));
            }
            text
        };
        let last = series.last().and_then(|(_, points)| points.last()).copied();
        html! {
            figure .chart {
                figcaption { (self.title) }
                svg viewBox={ "0 0 " (width) " " (height) } role="img" aria-label=(words) {
                    @for value in y.ticks() {
                        @let at = unit(up(value));
                        line .grid x1=(left) x2=(width - right) y1=(at) y2=(at) {}
                        text .tick x=(left - 8.0) y=(at) text-anchor="end" dominant-baseline="middle" { (tick(value)) }
                    }
                    @for value in x.ticks() {
                        text .tick x=(unit(across(value))) y=(height - bottom + 16.0) text-anchor="middle" { (tick(value)) }
                    }
                    text .axis x=(width - right) y=(height - 3.0) text-anchor="end" { (self.x) }
                    @for (series, points) in &series {
                        @if series.dots {
                            @for point in points {
                                circle .dot r="3.4" cx=(unit(across(point.0))) cy=(unit(up(point.1))) {}
                            }
                        } @else {
                            path .line .earlier[series.earlier] d=(path(points)) {}
                        }
                    }
                    @if let Some((at_x, at_y)) = last {
                        @if !series.last().is_some_and(|(it, _)| it.dots) {
                            circle .end r="3.4" cx=(unit(across(at_x))) cy=(unit(up(at_y))) {}
                        }
                    }
                }
            }
        }
    }

    /// What the `points` of the curve of interest show, for those who don't see it.
    fn in_words(&self, points: &[(f64, f64)]) -> String {
        let (Some(first), Some(last)) = (points.first(), points.last()) else {
            return self.title.to_owned();
        };
        let (low, high) = points.iter().fold((first.1, first.1), |(low, high), it| {
            (low.min(it.1), high.max(it.1))
        });
        let decimals = self.decimals;
        let at = |x: f64| match x.fract() == 0.0 && x >= 0.0 {
            true => whole(x as u64),
            false => tick(x),
        };
        format!(
            "{}, {}: {:.decimals$} at {}, {:.decimals$} at {}; lowest {low:.decimals$}, highest {high:.decimals$}",
            self.title,
            self.x,
            first.1,
            at(first.0),
            last.1,
            at(last.0)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart<'static> {
        Chart {
            title: "loss",
            x: "steps",
            series: vec![Series {
                points,
                ..Series::default()
            }],
            decimals: 3,
            may_be_log: (false, true),
        }
    }

    #[test]
    fn ticks_are_round_and_on_the_axis() {
        let axis = |values: [f64; 2], log| Axis::of(values.into_iter(), log).expect("values");
        assert_eq!(axis([0.0, 1000.0], false).ticks(), [0.0, 500.0, 1000.0]);
        assert_eq!(axis([21.3, 24.9], false).ticks(), [22.0, 23.0, 24.0]);
        let log = axis([0.001, 0.5], true);
        assert!(log.log && log.ticks().contains(&0.01), "{:?}", log.ticks());
        assert!(!axis([0.4, 0.5], true).log && !axis([-1.0, 100.0], true).log);
        // One value has an axis too.
        let one = axis([3.0, 3.0], false);
        assert_eq!(one.at(3.0), 0.5);
        assert!(!one.ticks().is_empty());
    }

    #[test]
    fn ticks_are_short() {
        let shown = [0.0, 0.5, 22.0, 5000.0, 12_000.0, 0.0125, 0.00001].map(tick);
        assert_eq!(shown, ["0", "0.5", "22", "5000", "12k", "0.0125", "1e-5"]);
    }

    #[test]
    fn a_curve_is_drawn_and_told() {
        let points: Vec<_> = (1..=2000)
            .map(|it| (f64::from(it), 1.0 / f64::from(it)))
            .collect();
        let drawn = chart(points).draw().into_string();
        let commands = drawn.matches('L').count();
        assert!(commands < DRAWN && commands > DRAWN / 2, "{commands}");
        assert!(
            drawn.contains("loss, steps: 1.000 at 1, 0.001 at 2000"),
            "{drawn}"
        );
        assert!(!drawn.contains("NaN") && !drawn.contains("inf"));
    }

    #[test]
    fn figures_that_are_none_are_left_out() {
        assert_eq!(chart(Vec::new()).draw().into_string(), "");
        assert_eq!(chart(vec![(1.0, f64::NAN)]).draw().into_string(), "");
        let drawn = chart(vec![(1.0, 2.0), (2.0, f64::INFINITY)]).draw();
        let drawn = drawn.into_string();
        assert!(
            drawn.contains("highest 2.000") && !drawn.contains("inf"),
            "{drawn}"
        );
    }
}

//! Positions of numbers on the page, and the ticks of an axis.

/// Share of an axis left free at both ends.
const MARGIN: f64 = 0.06;
/// Most ticks of an axis.
const MOST_TICKS: usize = 9;

/// One axis of the page.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl Axis {
    /// An axis for all `values`, which are finite, and above 0 on a logarithmic axis.
    pub(super) fn over(values: &[f64], logarithmic: bool) -> Self {
        let place = |value: &f64| if logarithmic { value.log10() } else { *value };
        let low = values.iter().map(place).fold(f64::INFINITY, f64::min);
        let high = values.iter().map(place).fold(f64::NEG_INFINITY, f64::max);
        // A single value gets room on both sides.
        let span = if high > low { high - low } else { 0.5 };
        Self {
            low: low - MARGIN * span,
            high: high + MARGIN * span,
            logarithmic,
        }
    }

    /// Position of `value`, 0 to 1 from the axis's start.
    pub(super) fn place(&self, value: f64) -> f64 {
        let value = if self.logarithmic {
            value.log10()
        } else {
            value
        };
        (value - self.low) / (self.high - self.low)
    }

    /// Round numbers along the axis, as many as fit.
    pub(super) fn ticks(&self) -> Vec<f64> {
        let steps: &[&[f64]] = match self.logarithmic {
            true => &[
                &[1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
                &[1.0, 2.0, 3.0, 4.0, 5.0, 7.0],
                &[1.0, 2.0, 5.0],
                &[1.0, 3.0],
            ],
            false => &[],
        };
        for mantissas in steps {
            let ticks = self.decades(mantissas, 1);
            if ticks.len() <= MOST_TICKS {
                return ticks;
            }
        }
        if self.logarithmic {
            let decades = (self.high - self.low).ceil() as i32;
            return self.decades(&[1.0], 1 + decades / MOST_TICKS as i32);
        }
        self.even()
    }

    /// Multiples of every `stride`-th power of ten.
    fn decades(&self, mantissas: &[f64], stride: i32) -> Vec<f64> {
        let powers = (self.low.floor() as i32..=self.high.ceil() as i32).step_by(stride as usize);
        powers
            .flat_map(|power| mantissas.iter().map(move |it| it * 10f64.powi(power)))
            .filter(|tick| (self.low..=self.high).contains(&tick.log10()))
            .collect()
    }

    /// Multiples of 1, 2 or 5 times a power of ten.
    fn even(&self) -> Vec<f64> {
        let span = self.high - self.low;
        let power = 10f64.powf((span / MOST_TICKS as f64).log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|it| it * power)
            .find(|step| span / step <= MOST_TICKS as f64)
            .unwrap_or(10.0 * power);
        let (first, last) = (
            (self.low / step).ceil() as i64,
            (self.high / step).floor() as i64,
        );
        (first..=last).map(|i| i as f64 * step).collect()
    }
}

/// A tick's number without rounding noise: `0.05`, `30`, `2.5`.
pub(super) fn plain(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        let ticks = |values: &[f64], logarithmic| -> Vec<String> {
            let axis = Axis::over(values, logarithmic);
            axis.ticks().into_iter().map(plain).collect()
        };
        assert_eq!(
            ticks(&[0.011, 0.9], true),
            ["0.01", "0.02", "0.05", "0.1", "0.2", "0.5", "1"]
        );
        assert_eq!(
            ticks(&[21.0, 29.0], false),
            ["21", "22", "23", "24", "25", "26", "27", "28", "29"]
        );
        assert_eq!(ticks(&[30.0], false).len(), 7);
        for span in [1.0 + 1e-3, 1.1, 2.0, 30.0, 1e3, 1e9, 1e30] {
            let count = ticks(&[0.02, 0.02 * span], true).len();
            assert!(count <= MOST_TICKS + 1, "{count} ticks over {span}");
        }
        assert_eq!(plain(-1e-9), "0");
    }

    #[test]
    fn places_follow_the_scale() {
        let axis = Axis::over(&[1.0, 100.0], true);
        assert!((axis.place(10.0) - 0.5).abs() < 1e-12);
        assert!(axis.place(1.0) > 0.0 && axis.place(100.0) < 1.0);
    }
}

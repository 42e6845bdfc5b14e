//! Colours continued from where they are known (the pull-push algorithm of Gortler and others, "The Lumigraph", 1996).

use super::Rgb;
use super::band::Band;

/// Colours of a band's crop at half of its resolution: they vary slowly where they are continued.
pub(super) struct Continued(Level);

impl Continued {
    /// Continues the colours that `known` gives, of an index in the crop and in the picture.
    pub(super) fn of(band: &Band, known: impl Fn(usize, usize) -> Option<Rgb>) -> Self {
        let [columns, rows] = band.size;
        let size = band.size.map(|it| it.div_ceil(2));
        let mut level = Level {
            size,
            colours: Vec::with_capacity(size[0] * size[1]),
            weights: Vec::with_capacity(size[0] * size[1]),
        };
        for y in (0..rows).step_by(2) {
            for x in (0..columns).step_by(2) {
                let at = y * columns + x;
                let colour = known(at, band.pixel(at));
                level.weights.push(f32::from(u8::from(colour.is_some())));
                level.colours.push(colour.unwrap_or_default());
            }
        }
        Self(filled(level))
    }

    /// The colour at an index in the crop.
    pub(super) fn at(&self, band: &Band, at: usize) -> Rgb {
        let [x, y] = [at % band.size[0] / 2, at / band.size[0] / 2];
        self.0.colours[y * self.0.size[0] + x]
    }
}

/// Colours of a crop, each with the weight of what is known, 0 to 1.
struct Level {
    size: [usize; 2],
    colours: Vec<Rgb>,
    weights: Vec<f32>,
}

/// A level whose unknown colours are smooth means of known ones, of the nearest mostly. Without a known colour, all are
/// black.
fn filled(level: Level) -> Level {
    if level.size == [1, 1] {
        return level;
    }
    let coarser = filled(level.halved());
    let mut level = level;
    level.fill(&coarser);
    level
}

impl Level {
    /// Means of two by two pixels by weight.
    fn halved(&self) -> Self {
        let size = self.size.map(|it| it.div_ceil(2));
        let mut half = Self {
            size,
            colours: vec![[0.0; 3]; size[0] * size[1]],
            weights: vec![0.0; size[0] * size[1]],
        };
        for (at, (colour, weight)) in self.colours.iter().zip(&self.weights).enumerate() {
            let to = at / self.size[0] / 2 * size[0] + at % self.size[0] / 2;
            half.weights[to] += weight;
            for (sum, value) in half.colours[to].iter_mut().zip(colour) {
                *sum += weight * value;
            }
        }
        for (colour, weight) in half.colours.iter_mut().zip(&mut half.weights) {
            if *weight > 0.0 {
                *colour = colour.map(|it| it / *weight);
            }
            *weight = weight.min(1.0);
        }
        half
    }

    /// Fills what is not known from the next `coarser` level, between its four nearest pixels.
    fn fill(&mut self, coarser: &Self) {
        let [columns, _] = self.size;
        for at in 0..self.colours.len() {
            let weight = self.weights[at];
            if weight >= 1.0 {
                continue;
            }
            let from = coarser.between(at % columns, at / columns);
            for (own, from) in self.colours[at].iter_mut().zip(from) {
                *own = weight * *own + (1.0 - weight) * from;
            }
        }
    }

    /// The colour at a pixel of the next finer level.
    fn between(&self, x: usize, y: usize) -> Rgb {
        // Three quarters of the pixel that covers it along each axis, a quarter of the nearest neighbour.
        let pair = |fine: usize, count: usize| {
            let own = fine / 2;
            let other = match fine % 2 {
                0 => own.saturating_sub(1),
                _ => (own + 1).min(count - 1),
            };
            [(own, 0.75), (other, 0.25)]
        };
        let mut sum = [0.0; 3];
        for (row, down) in pair(y, self.size[1]) {
            for (column, across) in pair(x, self.size[0]) {
                let colour = self.colours[row * self.size[0] + column];
                for (sum, value) in sum.iter_mut().zip(colour) {
                    *sum += down * across * value;
                }
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_stays_and_the_rest_follows_the_nearest() {
        let weights = (0..32).map(|at| f32::from(u8::from(at % 8 % 7 == 0)));
        let colours = (0..32).map(|at| [if at % 8 < 4 { 10.0 } else { 90.0 }; 3]);
        let filled = filled(Level {
            size: [8, 4],
            colours: colours.collect(),
            weights: weights.collect(),
        });
        for row in filled.colours.chunks(8) {
            assert_eq!((row[0], row[7]), ([10.0; 3], [90.0; 3]));
            assert!(row[1][0] < 40.0 && row[6][0] > 60.0, "{row:?}");
        }
    }
}

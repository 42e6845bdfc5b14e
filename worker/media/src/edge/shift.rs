//! The shift between two pictures of a hand-held camera that turned a little: one for all pixels.

/// Columns and rows that are searched at the coarsest level, on each side.
const SEARCH: i32 = 4;
/// Levels of a pyramid. With the search, shifts of up to 32 pixels are found.
const LEVELS: usize = 4;
/// A shift is taken if the mean difference falls to less than this share of that without a shift. Plain walls look alike everywhere.
const BETTER: f32 = 0.95;
/// One row in this number is compared.
const ROW_STEP: usize = 3;
/// Smallest share of the pixels that two pictures must both show.
const COMMON: f32 = 0.1;

/// Columns and rows from a pixel of one picture to the same thing in another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Shift([i32; 2]);

impl Shift {
    /// The index in the other picture, of the same size, of what is seen at index `at`.
    pub(super) fn of(self, at: usize, [columns, rows]: [usize; 2]) -> Option<usize> {
        let x = (at % columns).checked_add_signed(self.0[0] as isize)?;
        let y = (at / columns).checked_add_signed(self.0[1] as isize)?;
        (x < columns && y < rows).then_some(y * columns + x)
    }
}

/// Brightness of a picture at several resolutions, the finest first; NaN where it is unknown.
#[derive(Debug)]
pub(super) struct Pyramid(Vec<Level>);

#[derive(Debug)]
struct Level {
    size: [usize; 2],
    values: Vec<f32>,
}

impl Pyramid {
    /// The pyramid of a picture of `size` with the colours that `known` gives.
    pub(super) fn new(size: [usize; 2], known: impl Fn(usize) -> Option<[u8; 3]>) -> Self {
        let brightness = |at: usize| match known(at) {
            Some(colour) => colour.map(f32::from).iter().sum::<f32>() / 3.0,
            None => f32::NAN,
        };
        let mut levels = vec![Level {
            size,
            values: (0..size[0] * size[1]).map(brightness).collect(),
        }];
        for level in 1..LEVELS {
            let half = levels[level - 1].halved();
            levels.push(half);
        }
        Self(levels)
    }

    /// The shift from this picture to `other`, of the same size, from coarse to fine.
    pub(super) fn shift_to(&self, other: &Self) -> Shift {
        let (mut best, mut least) = ([0; 2], f32::INFINITY);
        for (level, (own, other)) in self.0.iter().zip(&other.0).enumerate().rev() {
            let reach = if level + 1 == LEVELS { SEARCH } else { 1 };
            best = best.map(|it| 2 * it);
            let from = best;
            least = own.difference(other, best);
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    let shift = [from[0] + dx, from[1] + dy];
                    let difference = own.difference(other, shift);
                    if difference < least {
                        (best, least) = (shift, difference);
                    }
                }
            }
        }
        let Some((own, other)) = self.0.first().zip(other.0.first()) else {
            return Shift::default();
        };
        let still = own.difference(other, [0; 2]);
        // Both are infinite for pictures that share too little.
        Shift(if least < BETTER * still { best } else { [0; 2] })
    }
}

impl Level {
    /// Means of two by two pixels; unknown where one is.
    fn halved(&self) -> Self {
        let [columns, _] = self.size;
        let size = self.size.map(|it| it / 2);
        let values = (0..size[0] * size[1]).map(|at| {
            let first = 2 * (at / size[0]) * columns + 2 * (at % size[0]);
            let four = [first, first + 1, first + columns, first + columns + 1];
            four.iter().map(|at| self.values[*at]).sum::<f32>() / 4.0
        });
        Self {
            size,
            values: values.collect(),
        }
    }

    /// Mean absolute difference from `other`, shifted; infinite if both know too little.
    fn difference(&self, other: &Self, shift: [i32; 2]) -> f32 {
        let [columns, rows] = self.size.map(|it| it as i32);
        let [left, top] = shift.map(|it| (-it).max(0));
        let [right, bottom] = [columns - shift[0].max(0), rows - shift[1].max(0)];
        if right <= left || bottom <= top {
            return f32::INFINITY;
        }
        let width = (right - left) as usize;
        let (mut sum, mut count) = (0.0, 0u32);
        for y in (top..bottom).step_by(ROW_STEP) {
            let at = (y * columns + left) as usize;
            let to = ((y + shift[1]) * columns + left + shift[0]) as usize;
            let pairs = self.values[at..at + width]
                .iter()
                .zip(&other.values[to..to + width]);
            let mut line = 0.0f32;
            for (a, b) in pairs {
                let off = (a - b).abs();
                if off.is_finite() {
                    line += off;
                    count += 1;
                }
            }
            sum += f64::from(line);
        }
        let enough = f64::from(count) >= f64::from(COMMON) * (self.values.len() / ROW_STEP) as f64;
        if enough && count > 0 {
            (sum / f64::from(count)) as f32
        } else {
            f32::INFINITY
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [160, 120];

    /// A pattern without repetition, seen from `x`, `y`; the middle is covered.
    fn seen(x: i32, y: i32) -> Pyramid {
        Pyramid::new(SIZE, |at| {
            let here = [(at % SIZE[0]) as i32, (at / SIZE[0]) as i32];
            let covered = (60..100).contains(&here[0]) && (30..120).contains(&here[1]);
            let (u, v) = ((here[0] + x) as f32, (here[1] + y) as f32);
            let value = 120.0
                + 60.0 * (0.11 * u + 0.05 * v).sin()
                + 50.0 * (0.15 * v - 0.0007 * u * u).sin();
            (!covered).then_some([value as u8; 3])
        })
    }

    #[test]
    fn a_turned_camera_is_followed() {
        for [x, y] in [[0, 0], [1, 0], [-3, 2], [9, -6], [-11, 0]] {
            assert_eq!(seen(x, y).shift_to(&seen(0, 0)), Shift([x, y]));
        }
    }

    #[test]
    fn a_plain_wall_and_an_unknown_one_do_not_move() {
        let plain = Pyramid::new(SIZE, |at| Some([100 + (at % 3) as u8; 3]));
        let unknown = Pyramid::new(SIZE, |_| None);
        for other in [&plain, &unknown] {
            assert_eq!(plain.shift_to(other), Shift::default());
        }
    }

    #[test]
    fn pictures_smaller_than_the_search_do_not_move() {
        for size in [[1, 1], [2, 40], [40, 3], [9, 9]] {
            let small = |from: usize| {
                Pyramid::new(size, move |at| Some([((at + from) * 31 % 255) as u8; 3]))
            };
            assert_eq!(small(0).shift_to(&small(0)), Shift::default());
            small(0).shift_to(&small(3));
        }
    }

    #[test]
    fn a_shift_ends_at_the_border() {
        let shift = Shift([2, -1]);
        assert_eq!(shift.of(SIZE[0] + 3, SIZE), Some(5));
        assert_eq!(shift.of(3, SIZE), None);
        assert_eq!(shift.of(2 * SIZE[0] - 1, SIZE), None);
    }
}

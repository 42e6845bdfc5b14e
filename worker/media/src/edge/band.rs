//! The pixels whose coverage is uncertain: those near the mask's edge.

/// Uncertain pixels lie at most this share of the person's longer side from the mask's edge, pixels per pixel.
/// Masks of the pose network are off by 0.4 to 0.8 % (docs/research/edges.md).
const REACH: f64 = 0.010;
/// Coverage that counts as inside.
const INSIDE: u8 = 230;
/// Coverage that counts as outside.
const OUTSIDE: u8 = 25;

/// Steps to a pixel's eight neighbours.
pub(super) const DIRECTIONS: [[isize; 2]; 8] = [
    [1, 0],
    [1, 1],
    [0, 1],
    [-1, 1],
    [-1, 0],
    [-1, -1],
    [0, -1],
    [1, -1],
];

/// The certainty of a pixel's coverage, before its colour is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Zone {
    /// Far outside of the mask.
    Background,
    /// Near the edge.
    Uncertain,
    /// Far inside of the mask.
    Foreground,
}

/// The crop around a person, with the zone of each pixel.
pub(super) struct Band {
    /// Width of the picture.
    stride: usize,
    /// First column and first row of the crop.
    origin: [usize; 2],
    /// Columns and rows of the crop.
    pub size: [usize; 2],
    /// Farthest distance of an uncertain pixel from the edge, pixels.
    reach: usize,
    /// `[rows, columns]`.
    pub zones: Vec<Zone>,
}

impl Band {
    /// The band around the edge of `mask` of a picture with `width` columns; `None` if nothing lies inside.
    pub(super) fn around(mask: &[u8], width: usize) -> Option<Self> {
        let height = mask.len() / width.max(1);
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for (at, _) in mask.iter().enumerate().filter(|(_, it)| **it >= INSIDE) {
            let here = [at % width, at / width];
            for axis in 0..2 {
                low[axis] = low[axis].min(here[axis]);
                high[axis] = high[axis].max(here[axis] + 1);
            }
        }
        let longer = (0..2)
            .map(|axis| high[axis].saturating_sub(low[axis]))
            .max()?;
        if longer == 0 {
            return None;
        }
        let reach = ((longer as f64 * REACH).round() as usize).max(1);
        // Beyond the uncertain pixels, as far again is kept to continue the background from.
        let around = 4 * reach;
        let origin = low.map(|it| it.saturating_sub(around));
        let end = [
            (high[0] + around).min(width),
            (high[1] + around).min(height),
        ];
        let size = [end[0] - origin[0], end[1] - origin[1]];
        let crop = |keep: &dyn Fn(u8) -> bool| -> Vec<bool> {
            (0..size[1])
                .flat_map(|row| {
                    let first = (origin[1] + row) * width + origin[0];
                    mask[first..first + size[0]].iter().map(|it| keep(*it))
                })
                .collect()
        };
        let not_inside = widened(crop(&|it| it < INSIDE), size, reach);
        let not_outside = widened(crop(&|it| it > OUTSIDE), size, reach);
        let zones = not_inside.into_iter().zip(not_outside);
        let zones = zones.map(
            |(not_inside, not_outside)| match (not_inside, not_outside) {
                (false, _) => Zone::Foreground,
                (true, false) => Zone::Background,
                (true, true) => Zone::Uncertain,
            },
        );
        Some(Self {
            stride: width,
            origin,
            size,
            reach,
            zones: zones.collect(),
        })
    }

    /// Sets the certain coverage: 0 far outside, full far inside.
    pub(super) fn settle(&self, mask: &mut [u8]) {
        mask.fill(0);
        for (at, zone) in self.zones.iter().enumerate() {
            if *zone == Zone::Foreground {
                mask[self.pixel(at)] = 255;
            }
        }
    }

    /// For each of the picture's `count` pixels, whether it is far outside of the mask.
    pub(super) fn background(&self, count: usize) -> Vec<bool> {
        let mut outside = vec![true; count];
        for (at, zone) in self.zones.iter().enumerate() {
            outside[self.pixel(at)] = *zone == Zone::Background;
        }
        outside
    }

    /// Index in the picture of a pixel of the crop.
    pub(super) fn pixel(&self, at: usize) -> usize {
        let [x, y] = [at % self.size[0], at / self.size[0]];
        (self.origin[1] + y) * self.stride + self.origin[0] + x
    }

    /// A pixel of the crop and its four neighbours; at the crop's border, itself again.
    pub(super) fn cross(&self, at: usize) -> [usize; 5] {
        let [columns, rows] = self.size;
        let (x, y) = (at % columns, at / columns);
        [
            at,
            if x > 0 { at - 1 } else { at },
            if x + 1 < columns { at + 1 } else { at },
            if y > 0 { at - columns } else { at },
            if y + 1 < rows { at + columns } else { at },
        ]
    }

    /// For each pixel of the crop, the first one in a direction that is far outside of the mask, if one is near.
    pub(super) fn outward(&self, [dx, dy]: [isize; 2]) -> Vec<Option<u32>> {
        let [columns, rows] = self.size;
        let mut first: Vec<Option<u32>> = vec![None; self.zones.len()];
        // Each pixel asks the next one in the direction, so that one comes before it.
        let forward = dy < 0 || (dy == 0 && dx < 0);
        let order = |i: usize, count: usize| if forward { i } else { count - 1 - i };
        for y in (0..rows).map(|i| order(i, rows)) {
            for x in (0..columns).map(|i| order(i, columns)) {
                let at = y * columns + x;
                if self.zones[at] == Zone::Background {
                    first[at] = Some(at as u32);
                    continue;
                }
                let next = x.checked_add_signed(dx).zip(y.checked_add_signed(dy));
                let next = next.filter(|(x, y)| *x < columns && *y < rows);
                let seen = next.and_then(|(x, y)| first[y * columns + x]);
                first[at] = seen.filter(|it| self.distance(at, *it as usize) <= 3 * self.reach);
            }
        }
        first
    }

    /// The larger of the columns and rows between two pixels of the crop.
    fn distance(&self, a: usize, b: usize) -> usize {
        let columns = self.size[0];
        (a % columns)
            .abs_diff(b % columns)
            .max((a / columns).abs_diff(b / columns))
    }

    /// The distance of pixels from the edge of `mask`.
    pub(super) fn depths(&self, mask: &[u8]) -> Depths {
        let [columns, rows] = self.size;
        let size = self.size.map(|it| it.div_ceil(2));
        let half: Vec<f32> = (0..rows)
            .step_by(2)
            .flat_map(|y| (0..columns).step_by(2).map(move |x| y * columns + x))
            .map(|at| f32::from(mask[self.pixel(at)]) / 255.0)
            .collect();
        let reach = self.reach.div_ceil(2);
        let mean = blurred(&blurred(&half, size, reach, 0), size, reach, 1);
        Depths {
            columns: size[0],
            values: mean.into_iter().map(|it| (2.0 * it - 1.0).abs()).collect(),
        }
    }
}

/// Distances from a mask's edge at half of a crop's resolution: |2 m − 1|, of the mean m within the band's reach.
pub(super) struct Depths {
    columns: usize,
    values: Vec<f32>,
}

impl Depths {
    /// The distance at a pixel of the crop: 0 at the edge, 1 where pixels are certain.
    pub(super) fn at(&self, band: &Band, at: usize) -> f32 {
        let [x, y] = [at % band.size[0] / 2, at / band.size[0] / 2];
        self.values[y * self.columns + x]
    }
}

/// Means of `values` within `reach` along an axis.
fn blurred(values: &[f32], size: [usize; 2], reach: usize, axis: usize) -> Vec<f32> {
    let step = [1, size[0]][axis];
    let mut means = vec![0.0; values.len()];
    let mut sums = Vec::with_capacity(size[axis] + 1);
    for line in 0..size[1 - axis] {
        let first = line * [size[0], 1][axis];
        sums.clear();
        let mut sum = 0.0;
        sums.push(sum);
        for i in 0..size[axis] {
            sum += values[first + i * step];
            sums.push(sum);
        }
        for i in 0..size[axis] {
            let (low, high) = (i.saturating_sub(reach), (i + reach + 1).min(size[axis]));
            means[first + i * step] = (sums[high] - sums[low]) / (high - low) as f32;
        }
    }
    means
}

/// The pixels within `reach` columns and rows of the coverage of `mask`, of a picture of `size`.
pub(super) fn near(mask: &[u8], size: [usize; 2], reach: usize) -> Vec<bool> {
    widened(mask.iter().map(|it| *it > OUTSIDE).collect(), size, reach)
}

/// `set`, grown by `reach` columns and rows.
fn widened(set: Vec<bool>, [columns, rows]: [usize; 2], reach: usize) -> Vec<bool> {
    let along = |set: &[bool], count: usize, step: usize, lines: usize, jump: usize| {
        let mut wide = vec![false; set.len()];
        for line in 0..lines {
            let at = |i: usize| line * jump + i * step;
            // One past the last pixel that the set's pixels so far reach.
            let mut until = 0;
            for i in 0..(count + reach) {
                if i < count && set[at(i)] {
                    until = i + 2 * reach + 1;
                }
                if i >= reach && i < until {
                    wide[at(i - reach)] = true;
                }
            }
        }
        wide
    };
    let wide = along(&set, columns, 1, rows, columns);
    along(&wide, rows, columns, columns, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_becomes_a_square_and_stops_at_the_border() {
        let mut set = vec![false; 7 * 5];
        set[7 + 1] = true;
        let wide = widened(set, [7, 5], 2);
        let expected = |x: usize, y: usize| x <= 3 && y <= 3;
        for y in 0..5 {
            for x in 0..7 {
                assert_eq!(wide[y * 7 + x], expected(x, y), "{x}, {y}");
            }
        }
    }
}

//! Conversion of a video decoder's planes to RGB.

/// Coding of colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coding {
    /// Weights of red and blue in luma.
    weights: (f32, f32),
    full_range: bool,
}

impl Coding {
    /// The coding for H.273's number of a matrix. 2, "not specified", means Rec. 601, the usual default of
    /// encoders. `None` for codings that are not luma and two colour differences.
    pub(super) fn new(matrix: u64, full_range: bool) -> Option<Self> {
        let weights = match matrix {
            1 => (0.2126, 0.0722),
            2 | 5 | 6 => (0.299, 0.114),
            4 => (0.30, 0.11),
            7 => (0.212, 0.087),
            9 => (0.2627, 0.0593),
            _ => return None,
        };
        Some(Self {
            weights,
            full_range,
        })
    }
}

/// Planes of a 4:2:0 picture: samples, and samples per row of each plane.
#[derive(Clone, Copy)]
pub(super) struct Planes<'a> {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) y: (&'a [u8], usize),
    pub(super) u: (&'a [u8], usize),
    pub(super) v: (&'a [u8], usize),
}

/// 16.16 fixed point.
const ONE: f32 = 65536.0;

/// RGB `[height, width, 3]` of 8 bits, as [`to_levels`].
pub(super) fn to_rgb(planes: Planes<'_>, coding: Coding) -> Option<Vec<u8>> {
    to_levels(planes, coding, |value| {
        ((value + (1 << 15)) >> 16).clamp(0, 255) as u8
    })
}

/// RGB `[height, width, 3]` of 16 bits, as [`to_levels`].
pub(super) fn to_deep_rgb(planes: Planes<'_>, coding: Coding) -> Option<Vec<u16>> {
    to_levels(planes, coding, |value| {
        ((i64::from(value) * 257) >> 16).clamp(0, 65_535) as u16
    })
}

/// RGB by linear interpolation of the chroma planes. Their samples are on every other column and between
/// every two rows (H.264's usual siting, figure E-1). `level` gets levels from 0 to 255 in 16.16 fixed point. `None` if a plane is
/// smaller than the picture.
fn to_levels<T: Copy + Default>(
    planes: Planes<'_>,
    coding: Coding,
    level: impl Fn(i32) -> T,
) -> Option<Vec<T>> {
    let Planes { width, height, .. } = planes;
    let (columns, rows) = (width.div_ceil(2), height.div_ceil(2));
    let (luma_scale, chroma_scale, black) = if coding.full_range {
        (1.0, 1.0, 0)
    } else {
        (255.0 / 219.0, 255.0 / 224.0, 16)
    };
    let (red, blue) = coding.weights;
    let green = 1.0 - red - blue;
    let fixed = |value: f32| (value * ONE).round() as i32;
    let luma = fixed(luma_scale);
    // The interpolation weights, 3 + 1 down and 1 + 1 across, leave differences eight times as large.
    let chroma = |value: f32| fixed(value * chroma_scale / 8.0);
    let to_red = chroma(2.0 * (1.0 - red));
    let to_blue = chroma(2.0 * (1.0 - blue));
    let green_red = chroma(2.0 * (1.0 - red) * red / green);
    let green_blue = chroma(2.0 * (1.0 - blue) * blue / green);

    let mut rgb = vec![T::default(); width * height * 3];
    let mut mixed = [vec![0i32; columns], vec![0i32; columns]];
    for (row, out) in rgb.chunks_exact_mut(width * 3).enumerate() {
        let y = planes.y.0.get(row * planes.y.1..)?.get(..width)?;
        let near = row / 2;
        let far = if row % 2 == 0 {
            near.saturating_sub(1)
        } else {
            (near + 1).min(rows - 1)
        };
        for (mixed, (plane, stride)) in mixed.iter_mut().zip([planes.u, planes.v]) {
            let near = plane.get(near * stride..)?.get(..columns)?;
            let far = plane.get(far * stride..)?.get(..columns)?;
            for ((mixed, &near), &far) in mixed.iter_mut().zip(near).zip(far) {
                *mixed = 3 * i32::from(near) + i32::from(far) - 4 * 128;
            }
        }
        let [u, v] = &mixed;
        for (column, (out, &y)) in out.chunks_exact_mut(3).zip(y).enumerate() {
            let at = column / 2;
            let next = if column % 2 == 0 {
                at
            } else {
                (at + 1).min(columns - 1)
            };
            let (u, v) = (u[at] + u[next], v[at] + v[next]);
            let y = (i32::from(y) - black) * luma;
            out[0] = level(y + to_red * v);
            out[1] = level(y - green_red * v - green_blue * u);
            out[2] = level(y + to_blue * u);
        }
    }
    Some(rgb)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(y: u8, u: u8, v: u8, coding: Coding) -> Vec<u8> {
        let planes = Planes {
            width: 3,
            height: 3,
            y: (&[y; 9], 3),
            u: (&[u; 4], 2),
            v: (&[v; 4], 2),
        };
        to_rgb(planes, coding).expect("large enough")
    }

    #[test]
    fn primaries_come_out_under_each_matrix_and_range() {
        let sd = Coding::new(2, false).expect("known");
        assert_eq!(flat(16, 128, 128, sd), [0; 27]);
        assert_eq!(flat(235, 128, 128, sd), [255; 27]);
        assert_eq!(flat(81, 90, 240, sd)[..3], [254, 0, 0], "red by Rec. 601");
        let hd = Coding::new(1, false).expect("known");
        assert_eq!(flat(63, 102, 240, hd)[..3], [255, 1, 0], "red by Rec. 709");
        let full = Coding::new(6, true).expect("known");
        assert_eq!(flat(255, 128, 128, full)[..3], [255; 3]);
        assert_eq!(flat(7, 128, 128, full)[..3], [7; 3]);
        assert_eq!(Coding::new(0, true), None, "RGB planes");
    }

    #[test]
    fn deep_levels_lie_between_those_of_eight_bits() {
        let coding = Coding::new(9, false).expect("known");
        let planes = Planes {
            width: 1,
            height: 1,
            y: (&[100], 1),
            u: (&[140], 1),
            v: (&[110], 1),
        };
        let deep = to_deep_rgb(planes, coding).expect("large enough");
        let rounded = deep.iter().map(|it| ((u32::from(*it) + 128) / 257) as u8);
        assert!(rounded.eq(to_rgb(planes, coding).expect("large enough")));
        assert!(deep.iter().any(|it| it % 257 != 0), "{deep:?}");
    }

    #[test]
    fn short_planes_are_refused() {
        let planes = Planes {
            width: 4,
            height: 4,
            y: (&[0; 16], 4),
            u: (&[0; 4], 2),
            v: (&[0; 3], 2),
        };
        assert!(to_rgb(planes, Coding::new(2, false).expect("known")).is_none());
    }
}

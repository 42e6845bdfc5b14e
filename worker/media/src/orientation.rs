//! Orientation of stored pictures, from the display matrix of an MP4.

use crate::Picture;

/// Rotation from a stored picture to the shown one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Orientation {
    /// As stored.
    #[default]
    AsStored,
    /// A quarter turn clockwise.
    Clockwise,
    /// A half turn.
    Half,
    /// A quarter turn counter-clockwise.
    CounterClockwise,
}

impl Orientation {
    /// From an MP4 display matrix `[a b; c d]` in 16.16 fixed point: x' = a x + c y,
    /// y' = b x + d y. Cameras only use quarter turns; `None` for other
    /// matrices, including mirrorings.
    pub fn from_matrix(a: i32, b: i32, c: i32, d: i32) -> Option<Self> {
        // Rounded to -1, 0 or 1 at a half, so that small errors and a scale don't matter. `unsigned_abs`,
        // since a hostile `i32::MIN` has no `abs`.
        let sign = |v: i32| v.signum() * i32::from(v.unsigned_abs() > 0x8000);
        match (sign(a), sign(b), sign(c), sign(d)) {
            (1, 0, 0, 1) => Some(Self::AsStored),
            (0, 1, -1, 0) => Some(Self::Clockwise),
            (-1, 0, 0, -1) => Some(Self::Half),
            (0, -1, 1, 0) => Some(Self::CounterClockwise),
            _ => None,
        }
    }

    /// Width and height after the rotation.
    pub fn size(self, width: usize, height: usize) -> (usize, usize) {
        match self {
            Self::AsStored | Self::Half => (width, height),
            Self::Clockwise | Self::CounterClockwise => (height, width),
        }
    }

    /// The rotated picture.
    pub fn apply(self, picture: Picture) -> Picture {
        if self == Self::AsStored {
            return picture;
        }
        let (width, height) = self.size(picture.width, picture.height);
        let (w, h) = (picture.width, picture.height);
        // The stored pixel for the shown pixel (x, y).
        let from = |x: usize, y: usize| match self {
            Self::AsStored => y * w + x,
            Self::Clockwise => (h - 1 - x) * w + y,
            Self::Half => (h - 1 - y) * w + (w - 1 - x),
            Self::CounterClockwise => x * w + (w - 1 - y),
        };
        let mut rgb = Vec::with_capacity(picture.rgb.len());
        let mut alpha = picture.alpha.as_ref().map(|_| Vec::with_capacity(w * h));
        for y in 0..height {
            for x in 0..width {
                let at = from(x, y);
                rgb.extend_from_slice(&picture.rgb[at * 3..at * 3 + 3]);
                if let (Some(to), Some(source)) = (&mut alpha, &picture.alpha) {
                    to.push(source[at]);
                }
            }
        }
        Picture {
            width,
            height,
            rgb,
            alpha,
            lossy: picture.lossy,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3x2, told apart by the red channel: 0 1 2 / 3 4 5.
    fn picture() -> Picture {
        Picture {
            width: 3,
            height: 2,
            rgb: (0..6u8).flat_map(|i| [i, 0, 0]).collect(),
            alpha: Some((0..6).collect()),
            lossy: false,
        }
    }

    #[test]
    fn quarters_turn_the_right_way() {
        let reds = |orientation: Orientation| {
            let turned = orientation.apply(picture());
            assert_eq!((turned.width, turned.height), orientation.size(3, 2));
            let reds: Vec<u8> = turned.rgb.chunks(3).map(|p| p[0]).collect();
            assert_eq!(turned.alpha.as_deref(), Some(&reds[..]));
            reds
        };
        assert_eq!(reds(Orientation::AsStored), [0, 1, 2, 3, 4, 5]);
        assert_eq!(reds(Orientation::Clockwise), [3, 0, 4, 1, 5, 2]);
        assert_eq!(reds(Orientation::Half), [5, 4, 3, 2, 1, 0]);
        assert_eq!(reds(Orientation::CounterClockwise), [2, 5, 1, 4, 0, 3]);
    }

    #[test]
    fn display_matrices_of_quarter_turns_are_known_and_mirrors_are_not() {
        let one = 1 << 16;
        assert_eq!(
            Orientation::from_matrix(one, 0, 0, one),
            Some(Orientation::AsStored)
        );
        assert_eq!(
            Orientation::from_matrix(0, one, -one, 0),
            Some(Orientation::Clockwise)
        );
        assert_eq!(
            Orientation::from_matrix(-one, 0, 0, -one),
            Some(Orientation::Half)
        );
        assert_eq!(
            Orientation::from_matrix(0, -one, one, 0),
            Some(Orientation::CounterClockwise)
        );
        assert_eq!(Orientation::from_matrix(-one, 0, 0, one), None);
        assert_eq!(Orientation::from_matrix(0, 0, 0, 0), None);
        assert_eq!(
            Orientation::from_matrix(i32::MIN, 0, 0, i32::MIN),
            Some(Orientation::Half)
        );
    }
}

//! Orientation of stored pictures, from the display matrix of an MP4.

/// Rotation from a stored picture to the shown one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Orientation {
    /// Shown as stored.
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

    /// The rotated picture of `samples`, `[h, w, 3]`.
    pub(crate) fn apply<T: Copy>(self, w: usize, h: usize, samples: &[T]) -> Vec<T> {
        let (width, height) = self.size(w, h);
        // The stored pixel for the shown pixel (x, y).
        let from = |x: usize, y: usize| match self {
            Self::AsStored => y * w + x,
            Self::Clockwise => (h - 1 - x) * w + y,
            Self::Half => (h - 1 - y) * w + (w - 1 - x),
            Self::CounterClockwise => x * w + (w - 1 - y),
        };
        let mut turned = Vec::with_capacity(samples.len());
        for y in 0..height {
            for x in 0..width {
                let at = 3 * from(x, y);
                turned.extend_from_slice(&samples[at..at + 3]);
            }
        }
        turned
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarters_turn_the_right_way() {
        let reds = |orientation: Orientation| -> Vec<u8> {
            // 3x2, told apart by the red channel: 0 1 2 / 3 4 5.
            let rgb: Vec<u8> = (0..6u8).flat_map(|i| [i, 0, 0]).collect();
            let turned = orientation.apply(3, 2, &rgb);
            turned.chunks(3).map(|p| p[0]).collect()
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

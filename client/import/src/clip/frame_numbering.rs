//! Whether a file counts the frames of a clip from 0 or from 1.

/// How a file counts the frames of a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameNumbering {
    /// Number of the clip's first frame.
    pub first: usize,
    /// Whether the numbers allow no other first frame.
    pub is_sure: bool,
}

impl FrameNumbering {
    /// The numbering of a file with these `numbers`, for a clip of `frames` frames, by a program that usually counts
    /// from `usual`.
    ///
    /// A 0 is the first frame. Without a 0, the first frame is 1 if the clip has too few frames for the last number. That is
    /// sure if every frame then has a number. The remaining files lack frames at one end.
    pub(crate) fn of(numbers: impl Iterator<Item = usize>, frames: usize, usual: usize) -> Self {
        let (mut least, mut last) = (usize::MAX, 0);
        for number in numbers {
            (least, last) = (least.min(number), last.max(number));
        }
        match least {
            0 => Self {
                first: 0,
                is_sure: true,
            },
            _ if last >= frames && least <= last => Self {
                first: 1,
                is_sure: least == 1 && last == frames,
            },
            1 => Self {
                first: usual,
                is_sure: false,
            },
            _ => Self {
                first: 0,
                is_sure: false,
            },
        }
    }

    /// The other number that the first frame may have.
    pub(crate) fn other(self) -> usize {
        1 - self.first.min(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(numbers: impl IntoIterator<Item = usize>, usual: usize) -> (usize, bool) {
        let found = FrameNumbering::of(numbers.into_iter(), 10, usual);
        (found.first, found.is_sure)
    }

    #[test]
    fn all_numbers_say_where_a_file_begins() {
        assert_eq!(counted(0..10, 1), (0, true));
        assert_eq!(counted(1..11, 0), (1, true));
        // A surplus pose at either end.
        assert_eq!(counted(0..12, 1), (0, true));
        assert_eq!(counted(1..12, 0), (1, false));
        // Poses that begin or end within the clip.
        assert_eq!(counted(1..9, 0), (0, false));
        assert_eq!(counted(1..9, 1), (1, false));
        assert_eq!(counted(4..9, 1), (0, false));
        assert_eq!(counted(4..11, 0), (1, false));
        assert_eq!(counted([], 1), (0, false));
    }
}

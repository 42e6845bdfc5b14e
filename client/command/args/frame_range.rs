//! `--range`: frames by number.

use yoto_proto::v1::{CaptureMotion, FilmRange};

/// `A..B:STEP`: every STEP-th frame from number A on, below number B. Each of the three may be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct FrameRange {
    pub first: u32,
    pub end: u32,
    pub step: u32,
}

impl FrameRange {
    /// All frames.
    pub(crate) const ALL: Self = Self {
        first: 0,
        end: u32::MAX,
        step: 1,
    };

    /// The pictures of a film in the range.
    pub(crate) fn of_film(self) -> FilmRange {
        FilmRange {
            first: self.first,
            count: self.count(),
            step: self.step,
        }
    }

    /// The frames of a capture's motion with numbers in the range, every `step`-th stored one. The motion is the
    /// actor's own until a driver is set. A range from 0 on begins at the capture's first frame, whatever its number.
    pub(crate) fn of_capture(self) -> CaptureMotion {
        CaptureMotion {
            driver: String::new(),
            first_frame: (self.first > 0).then_some(self.first),
            // The most that there can be. A worker that does not know `end_frame` counts by it alone.
            frame_count: self.count(),
            frame_step: self.step,
            end_frame: (self.end != Self::ALL.end).then_some(self.end),
        }
    }

    /// Number of frames in the range, if each number has one; 0 if it has no end.
    pub(crate) fn count(self) -> u32 {
        match self.end {
            u32::MAX => 0,
            end => (end - self.first).div_ceil(self.step),
        }
    }
}

impl std::str::FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let shape = || format!("'{text}' is not of the form A..B or A..B:STEP, e.g. 0..60:2");
        let (range, step) = text.split_once(':').unwrap_or((text, "1"));
        let (first, end) = range.split_once("..").ok_or_else(shape)?;
        let number = |part: &str, absent: u32| match part {
            "" => Ok(absent),
            part => part.parse::<u32>().map_err(|_| shape()),
        };
        let range = Self {
            first: number(first, Self::ALL.first)?,
            end: number(end, Self::ALL.end)?,
            step: step.parse().map_err(|_| shape())?,
        };
        if range.step == 0 || range.end <= range.first {
            return Err(format!(
                "'{text}' holds no frame: B must be above A and STEP above 0"
            ));
        }
        Ok(range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_count_their_frames() {
        let range: FrameRange = "10..20:3".parse().expect("a range");
        assert_eq!(
            (range, range.count()),
            (
                FrameRange {
                    first: 10,
                    end: 20,
                    step: 3
                },
                4
            )
        );
        assert_eq!("0..5".parse::<FrameRange>().map(FrameRange::count), Ok(5));
        assert_eq!("..".parse(), Ok(FrameRange::ALL));
        assert_eq!("7..".parse::<FrameRange>().map(FrameRange::count), Ok(0));
        assert_eq!("..7:2".parse::<FrameRange>().map(FrameRange::count), Ok(4));
        for bad in ["", "5", "5..5", "9..2", "0..9:0", "a..b", "0..9:", "-1..3"] {
            assert!(bad.parse::<FrameRange>().is_err(), "{bad}");
        }
    }

    #[test]
    fn a_range_has_the_numbers_of_frames_and_steps_over_stored_ones() {
        let part = |range: &str| {
            let part = range.parse::<FrameRange>().expect("a range").of_capture();
            let ends = (part.first_frame, part.end_frame);
            (ends, part.frame_count, part.frame_step)
        };
        assert_eq!(part("60..120"), ((Some(60), Some(120)), 60, 1));
        assert_eq!(part("..60:4"), ((None, Some(60)), 15, 4));
        assert_eq!(part("0..61:4"), ((None, Some(61)), 16, 4));
        assert_eq!(part("7..:2"), ((Some(7), None), 0, 2));
        assert_eq!(part(".."), ((None, None), 0, 1));
    }
}

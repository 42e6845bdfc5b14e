//! The part of a capture's motion that a range chooses.

use super::render_what::FrameRange;
use yoto_client::YotoClient;
use yoto_proto::v1::{CaptureMotion, Subject, capture::State};

impl FrameRange {
    /// The part of a capture's motion, of the actor's own until it has a driver: frames by their numbers, of which
    /// every `step`-th stored one is taken. From 0 on means from the capture's first frame on, whatever its number.
    pub(super) fn of_capture(self) -> CaptureMotion {
        CaptureMotion {
            driver: String::new(),
            first_frame: (self.first > 0).then_some(self.first),
            // The most that there can be. A worker that does not know `end_frame` counts by it alone.
            frame_count: self.count(),
            frame_step: self.step,
            end_frame: (self.end != Self::ALL.end).then_some(self.end),
        }
    }
}

/// Says so if `range` goes on beyond the capture of `driver` that a job takes, if there is one: what is wrong otherwise, the
/// job says.
pub(super) async fn tell_end(client: &YotoClient, driver: &Subject, range: FrameRange) {
    let Some(end) = range.of_capture().end_frame else {
        return;
    };
    for name in driver.captures.iter().rev() {
        let Ok(capture) = client.get_capture(name).await else {
            return;
        };
        if capture.state() != State::Ready {
            continue;
        }
        if let Some(last) = capture.last_frame.filter(|last| end - 1 > *last) {
            let name = &driver.display_name;
            tell!("note: the last frame of {name} has the number {last}: --range ends there");
        }
        return;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

//! A note about a range that is longer than a capture.

use crate::args::frame_range::FrameRange;
use yoto_client::YotoClient;
use yoto_proto::v1::Subject;
use yoto_proto::v1::capture::State;

/// Prints a note if `range` goes beyond the last frame of the capture of `driver` that a job reads. Prints nothing if
/// that capture can't be found: the job then reports the fault.
pub(crate) async fn note_capture_end(client: &YotoClient, driver: &Subject, range: FrameRange) {
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

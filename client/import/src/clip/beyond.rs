//! Poses and points beyond a clip's last frame.

use yoto_proto::text::count;

/// This number of frames beyond the last is left out for clips of any length: decoders disagree about the last frames.
const FEW: usize = 5;
/// One frame in this many is left out beyond the end of longer clips.
const SHARE: usize = 20;

/// The first frame number that is too far beyond a clip of `frames` frames, as for captures (`docs/use/media.md`).
pub(crate) fn too_far(frames: usize) -> usize {
    frames + FEW.max(frames / SHARE)
}

/// A note about `what` for `beyond` frames after the last of a clip of `frames` frames.
pub(crate) fn note(what: &str, beyond: usize, frames: usize) -> Option<String> {
    (beyond > 0).then(|| {
        format!(
            "{} of {what} beyond the clip's {frames}: left out",
            count(beyond, "frame")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_frames_are_no_other_clip() {
        assert_eq!(too_far(65), 70);
        assert_eq!(too_far(1000), 1050);
        assert_eq!(note("poses", 0, 9), None);
        let expected = "2 frames of poses beyond the clip's 9: left out";
        assert_eq!(note("poses", 2, 9).as_deref(), Some(expected));
    }
}

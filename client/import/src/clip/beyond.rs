//! Poses and points beyond a clip's last frame.

use yoto_proto::text::count;

/// Frames beyond the last that are left out whatever the clip's length: decoders disagree about the last ones.
const FEW: usize = 5;
/// Longer clips may have this part of their frames too many.
const SHARE: usize = 20;

/// The first number that can't be of a clip of `frames` frames, as for captures (`docs/use/media.md`).
pub(crate) fn too_far(frames: usize) -> usize {
    frames + FEW.max(frames / SHARE)
}

/// A note about `beyond` things of frames that a clip of `frames` frames lacks.
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

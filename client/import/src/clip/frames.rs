//! The frames of a clip, decoded one at a time.

use super::{Clip, PICTURES, fault, listed, unusable};
use crate::ImportError;
use crate::pictures::read_image;

/// Calls `each` with the pixels `[height, width, 3]` of each frame in `wanted`, in ascending order.
///
/// # Errors
/// A frame that is missing, can't be decoded or has another size; what `each` returns.
pub(crate) fn for_each(
    clip: &Clip,
    wanted: &[usize],
    mut each: impl FnMut(usize, &[u8]) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let path = clip.path();
    if path.is_dir() {
        let files = listed(path, &PICTURES)?;
        for &frame in wanted {
            let file = files.get(frame);
            let file = file.ok_or_else(|| fault(path, "MISSING", "a picture was taken away"))?;
            each(frame, read_image(file, clip.size, frame as u32)?.as_raw())?;
        }
        return Ok(());
    }
    let mut video = clip.own_video()?;
    let mut next = 0;
    for &frame in wanted {
        while next < frame {
            video.next(true).map_err(|error| unusable(path, error))?;
            next += 1;
        }
        let picture = video.next(false).map_err(|error| unusable(path, error))?;
        let picture = picture
            .ok_or_else(|| fault(path, "CUT", format!("the video ends before frame {frame}")))?;
        next += 1;
        let size = [picture.width as u32, picture.height as u32];
        if size != clip.size {
            let message = format!(
                "frame {frame} has {}x{} pixels, the first {}x{}",
                size[0], size[1], clip.size[0], clip.size[1]
            );
            return Err(fault(path, "SIZE_MISMATCH", message));
        }
        each(frame, &picture.rgb)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Options;
    use std::path::Path;

    /// Brightness of each frame in `wanted` of the clip at `path`.
    fn sums(path: &Path, wanted: &[usize]) -> Result<Vec<(usize, u64)>, ImportError> {
        let clip = Clip::open(path, &Options::default())?;
        let mut sums = Vec::new();
        for_each(&clip, wanted, |frame, rgb| {
            sums.push((frame, rgb.iter().map(|level| u64::from(*level)).sum()));
            Ok(())
        })?;
        Ok(sums)
    }

    #[test]
    fn frames_of_a_video_are_those_of_their_numbers() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let video = here.join("../../worker/media/tests/clips/b_frames.mp4");
        let all = sums(&video, &[0, 1, 2, 3, 4, 5]).expect("six frames");
        let some = sums(&video, &[1, 4]).expect("two frames");
        assert_eq!(some, [all[1], all[4]]);
        assert_ne!(all[1].1, all[4].1, "the clip moves");
        let error = sums(&video, &[9999]).expect_err("beyond the end");
        assert!(error.to_string().contains("9999"), "{error}");
    }

    #[test]
    fn frames_of_a_folder_are_in_the_order_of_their_names() {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, level) in [("b.png", 20), ("a.png", 10), ("c.png", 30)] {
            let picture = image::RgbImage::from_pixel(2, 1, image::Rgb([level; 3]));
            picture.save(folder.path().join(name)).expect("a picture");
        }
        let sums = sums(folder.path(), &[0, 2]).expect("pictures");
        assert_eq!(sums, [(0, 60), (2, 180)]);
    }
}

//! Poses beyond the end of a capture's videos.

use std::collections::BTreeMap;
use std::path::PathBuf;
use yoto_media::{Limits, video};
use yoto_proto::media_plan::{Pictures, Planned, Sources, Timing, VideoContent};
use yoto_proto::v1::Violation;

/// Removes the few frames of `planned` beyond the end of a video of `sources`, with a note. `files` has the path of each
/// file on this disk. A video that can't be read, or without its end in its headers, removes nothing: decoding it finds
/// the fault.
///
/// # Errors
/// If the track is much longer than a video, as in [`Planned::end_with`].
pub fn end_with_videos(
    planned: &mut Planned,
    sources: &Sources,
    files: &BTreeMap<String, PathBuf>,
    timing: Timing,
    limits: &Limits,
) -> Result<(), Violation> {
    let images = (Some(sources.images.clone()), VideoContent::Images);
    for (pictures, shows) in [images, (sources.mask_pictures(), VideoContent::Masks)] {
        let Some(Pictures::Video(name)) = pictures else {
            continue;
        };
        let end = files.get(&name).map(|path| video::end(path, limits));
        if let Some(Ok(Some(end))) = end {
            planned.end_with(&name, shows, end, timing)?;
        }
    }
    Ok(())
}
